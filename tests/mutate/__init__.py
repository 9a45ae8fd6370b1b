"""Break one thing at a time and see whether a test goes red: ``python -m tests.mutate --help``.

Mutants are enumerated from the syntax trees of the files of a group. A server that has loaded what is heavy forks a
process for each; there the one module is loaded with its change, kernels run as plain Python, and the tests that reach
the changed line run, quickest first, until one fails. See docs/mutation.md.
"""
