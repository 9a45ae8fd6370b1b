"""The command line: one file a command."""

from ephs.cli.commands import app, main

__all__ = ["app", "main"]
