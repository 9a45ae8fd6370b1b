"""Curves of a solution: figures, and panels of pages.

In comes a solution; out go matplotlib figures or panels of curves. `series` prepares lines, `panels` names them; start
with `curves`.
"""
