"""The command line as one types it."""

import shlex

from ephs.cli import main


def typed(line: str) -> int:
    """The exit code of words after ``ephs``, which are told apart as shells do."""
    return main(shlex.split(line))
