"""Verdicts on structures: what is decided of the numbers as they are given, and whether a function is its record.

In: a primitive. Out: its conditions, proved or searched, or the error that refutes one. Start in `constant` and
`recorded`; `proving` finds evidence, and `replay` checks it.
"""
