"""Mechanisms in joint coordinates: found in the flat system, stated once as staged sweeps, evaluated."""
