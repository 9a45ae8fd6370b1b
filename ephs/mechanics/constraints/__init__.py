"""Constraints of mechanisms: dependent rows, free directions, and subgroups of joints."""
