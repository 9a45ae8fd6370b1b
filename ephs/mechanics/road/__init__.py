"""Motion of links in world axes: outward sweep, rows of constraints, one linear system; see docs/architecture.md."""
