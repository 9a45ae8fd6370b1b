"""Diagrams of patterns and systems.

In comes a pattern or system; out goes a placed picture, as SVG, bitmap or TikZ. `graph` makes nodes and edges,
`positions`, `routing` and `lettering` place them, `layout` does all in order: start there.
"""
