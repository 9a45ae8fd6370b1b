"""Where the real models are: in the wheel example-robot-data, of the extra ``real``."""

from importlib.metadata import files
from pathlib import Path


def found(ending):
    """Files of this ending that the wheel brings."""
    return sorted(Path(str(file.locate())) for file in files("example-robot-data") or () if file.name.endswith(ending))


def named(path):
    """A short name for a file."""
    return "/".join(path.parts[-3:])
