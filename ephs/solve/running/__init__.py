"""A run: the loop over steps, its journal, and what becomes of its end.

In come a problem and a method; out goes a `Solution`. Start with `loop`; `abreast` runs independent parts by it.
"""
