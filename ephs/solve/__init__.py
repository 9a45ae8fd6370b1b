"""Solvers of systems: problems, the time loop, methods, solutions, audits; independent of bodies and joints."""
