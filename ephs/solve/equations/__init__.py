"""The equations of a problem: compiled kernels, patterns of their matrices, and what is known before a step.

In comes a descriptor; out go a `Model`, its motions at a configuration, and checks of a start. Start with `model`.
"""
