"""Mutants that no test can see, each with why: ``equivalent.toml``."""

import tomllib
from pathlib import Path


def explained() -> dict[str, tuple[str, str]]:
    """(change, reason) of each, by its name. The change is there to notice when the name means another."""
    entries = tomllib.loads((Path(__file__).with_name("equivalent.toml")).read_text(encoding="utf-8"))
    return {
        name: (change, entry["why"])
        for entry in entries.get("because", [])
        for name, change in entry["mutants"].items()
    }
