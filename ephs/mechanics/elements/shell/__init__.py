"""Shells on SE(3): quadrilaterals whose edges have the strain of beams; statics, spectra and motion.

In come points, elements, a section and loads as arrays; out go poses of the nodes, energies, resultants, paths, modes.
`section` integrates layers, `mesh` checks elements and places sections at their corners, `stiffness` makes the constant
matrix of an element, `edges` is the staged program of all edges, and `shell` sums energies, forces and tangents of a
mesh; `statics` and `spectra` solve. `system` makes a shell a system that moves. Start reading at `shell`.
"""
