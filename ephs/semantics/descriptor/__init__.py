"""The square form for solvers."""
