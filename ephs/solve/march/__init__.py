"""Runge-Kutta steps, explicit, implicit or semi-implicit, as staged functions, many in one call; start with `march`."""
