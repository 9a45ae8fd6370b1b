"""Ensembles: one model with many values of some numbers, run in parallel, read as one table."""
