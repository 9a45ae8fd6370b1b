"""Runs of models: methods by name, inputs, journals, checks."""
