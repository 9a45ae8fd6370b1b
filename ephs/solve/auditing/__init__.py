"""Audit of a run: its laws, and estimates of its error and cost."""
