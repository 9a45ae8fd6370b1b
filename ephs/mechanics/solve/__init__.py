"""Solvers: the compiled model of a system, integrators, solutions. Nothing here knows of bodies or joints."""
