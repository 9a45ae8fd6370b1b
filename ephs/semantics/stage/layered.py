"""Evaluators over another one: conditions, integers and control are those of the base evaluator."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.memory import IntegerCells
from ephs.semantics.stage.numbers import Integer, Real, StagedCondition, Truth
from ephs.semantics.stage.reaching import Atom, Part, Reached, Signature


class Based(Evaluator):
    """An evaluator that has another one: conditions are those of the base."""

    __slots__ = ()
    base: Evaluator

    @final
    def _both(self, one: Truth, other: Truth) -> Truth:
        return self.base.both(one, other)

    @final
    def _negate(self, truth: StagedCondition) -> Truth:
        return self.base.negate(truth)

    @final
    def _same(self, one: Integer, other: Integer) -> Truth:
        return self.base.same(one, other)

    @final
    def _rehearse(self, body: Callable[[], None]) -> None:
        self.base._rehearse(body)


class Layered(Based):
    """An evaluator whose real numbers are those of the base with something beside them: slopes, or rows of a tape."""

    __slots__ = ()

    @abstractmethod
    def constant(self, number: Real) -> Real:
        """Return a number of the base as a constant."""

    @abstractmethod
    def bare(self, number: Real) -> Real:
        """Return the base's number of one."""

    @abstractmethod
    def _handed(self, cells: Any, start: Integer) -> tuple[Part, Part]:
        """What a called function gets of cells from a place on: the values, and what is beside them."""

    @abstractmethod
    def _tape(self) -> list[Part]:
        """Arguments that a called function gets after all others."""

    @final
    def real(self, integer: Integer) -> Real:
        return self.constant(self.base.real(integer))

    @final
    def integer(self, real: Real) -> Integer:
        return self.base.integer(self.bare(real))

    @final
    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        self.base.loop(count, body, start, down)

    @final
    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        self.base.when(truth, yes, no)

    @final
    def repeat(self, body: Callable[[], Truth]) -> None:
        self.base.repeat(body)

    @final
    def _wholes(self, size: int) -> IntegerCells:
        return self.base._wholes(size)

    @final
    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        """Call by address what does the same as this evaluator with the function that is meant: its tangent, or the
        function that writes to the same tape. Tables of such programs contain addresses of these.
        """
        rest, passed = iter(parts), list[Part]()
        arguments: list[tuple[Atom, ...]] = []
        for atoms in function.signature.arguments:
            more: list[Part] = []
            for atom, value in (next(rest) for _ in atoms):
                if atom == "real":
                    raise StageError("unreached", what="the derivative of a number that is handed over by itself")
                if atom != "reals":
                    passed.append((atom, value))
                    continue
                own, beside = self._handed(*value)
                passed.append(own)
                more.append(beside)
            passed += more
            arguments.append((*atoms, *(atom for atom, _ in more)))
        last = self._tape()
        signature = Signature((*arguments, *((atom,) for atom, _ in last)), function.signature.returns)
        return self.base._reach(Reached(signature, function.address), [*passed, *last])
