"""The audit of a run: what it is held against, and estimates of its error and cost."""
