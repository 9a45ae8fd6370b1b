"""Symbols: user functions traced with SymPy, their derivatives, kernels and formulas; equations of whole systems."""
