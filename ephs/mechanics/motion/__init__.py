"""Motions of mechanisms, read from solutions: poses, velocities, wrenches of bodies and joints."""
