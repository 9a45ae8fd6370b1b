"""Solvers of systems: problems, the time loop, methods, solutions, audits. Nothing here knows of bodies or joints."""
