"""A hard case: a model whose motion is known in closed form, or by an equation of its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, final

import ephs

__all__ = ["WEIGHTLESS", "Case", "read"]

Model = ephs.Scene | ephs.System
WEIGHTLESS = "[world]\ngravity = [0.0, 0.0, 0.0]\n"


@final
@dataclass(frozen=True, slots=True)
class Case:
    """A hard case.

    Parameters
    ----------
    name, words
        Short name; the difficulty, in words.
    make
        The model; it may be refused.
    until
        End of the run in s.
    error
        Of a solution to the end, relative to what moves: against the closed form or the independent equation.
    steps, tolerances
        Constant steps in s and tolerances, rtol = atol, at which it is run.
    options
        Further options of `ephs.simulate`.
    instants
        How many are kept, evenly spread, without the start.
    exact
        Largest error of a right run where the law holds to rounding at any setting; None: it follows from the setting.
    """

    name: str
    words: str
    make: Callable[[], Model]
    until: float
    error: Callable[[ephs.Solution], float]
    steps: tuple[float, ...] = ()
    tolerances: tuple[float, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    instants: int = 10
    exact: float | None = None


def read(text: str, world: str = "", name: str = "hard") -> ephs.Scene:
    """A scene from its tables, which `world` comes before."""
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{name}.toml")
        file.write_text(f'format = 1\nname = "{name}"\n{world}{text}', encoding="utf-8")
        return ephs.load(file)
