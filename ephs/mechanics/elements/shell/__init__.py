"""Shells on SE(3): quadrilaterals whose edges have the strain of beams; statics and spectra by sparse solvers."""
