"""The command line: one file per command."""

from ephs.cli.commands import app, main

__all__ = ["app", "main"]
