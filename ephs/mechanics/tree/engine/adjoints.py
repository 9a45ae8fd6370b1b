"""Reverse accumulation through explicit steps: gradients by all numbers that a step reads."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, final

from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.tangents import StepTangent, reaching, step_program
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Program
from ephs.semantics.stage.gradients import Gradients, Shares


@final
class StepAdjoint:
    """Steps of one mechanism, and the same backwards.

    Parameters
    ----------
    engine, relation
        As of `StepTangent`.
    tangent
        Steps forward, whose arrays are taken.
    """

    def __init__(self, engine: Engine, relation: Callable[..., tuple[Program, str]], tangent: StepTangent) -> None:
        entries = step_program(looped=engine.looped).entries
        given = {name: _values(tangent.given[name]) for name in entries["step"].kinds}
        self._arrays = {name: given[name] for name in ("base", "start", "q", "y")}
        self._forward = Program("forward", 0, step=entries["step"]).compiled()["step"].bind(*given.values())
        taped = {**given, "tables": {**given["tables"], **reaching(engine, relation, Program.taped)}}
        self._back = Gradients(entries["step"], **taped)
        self._sum: Shares | None = None
        self._close = partial(Gradients, entries["close"], **{name: taped[name] for name in entries["close"].kinds})
        self._first: Mapping[str, Array] = {}
        self._looped = engine.looped

    @property
    def tables(self) -> Mapping[str, Array]:
        """The function's derivative by each real number of each table, by its name: the sum of all taken back."""
        found, start = self._sum or {}, "tables."
        of_tables = [name for name in found if name.startswith(start)]
        return {name.removeprefix(start): found[name] + self._first.get(name, 0.0) for name in of_tables}

    def step(self, q: Array, y: Array, h: float) -> tuple[int, Array, Array]:
        """Take a step of h seconds: a status, and elements and y at its end."""
        self._arrays["base"][:], self._arrays["start"][:] = q, y
        status = int(self._forward(h))
        return status, self._arrays["q"].copy(), self._arrays["y"].copy()

    def begin(self, q: Array, y: Array, by_q: Array, by_y: Array) -> tuple[Array, Array]:
        """Take derivatives by a state whose loops are closed back to one where they are so but for derivatives."""
        if not self._looped:
            return by_q, by_y
        self._arrays["q"][:], self._arrays["y"][:] = q, y
        closing = self._close()
        closing.run()
        self._first = found = closing.pull({"q": by_q, "y": by_y})
        return found["q"], found["y"]

    def back(self, q: Array, y: Array, h: float, by_q: Array, by_y: Array) -> tuple[Array, Array]:
        """Take a function's derivatives by the end of the step from (q, y) back to its start, and to the tables."""
        self._arrays["base"][:], self._arrays["start"][:] = q, y
        self._back.run(h=h)
        found = self._back.pull({"q": by_q, "y": by_y})
        if self._sum is None:
            self._sum = found
        else:
            self._sum.flat[:] += found.flat
        return found["base"], found["start"]


def _values(argument: Any) -> Any:
    """An argument without its slopes."""
    if isinstance(argument, Mapping):
        return {name: _values(part) for name, part in argument.items()}
    return argument[0] if isinstance(argument, tuple) else argument
