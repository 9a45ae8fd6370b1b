"""Matrices of implicit stages, made at a state and factorised for a step, which are kept while they serve.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8. One statement for equations of systems and of
mechanisms: when matrices are made anew, when they are factorised, and what a run that goes on needs of them.
"""

from collections.abc import Callable
from typing import Any, Generic, TypeVar, final

from ephs.solve.methods.collocation import Collocation
from ephs.solve.methods.solvers import Solver
from ephs.solve.posing.errors import SolveError
from ephs.solve.running.snapshot import Snapshot, like, parts

S = TypeVar("S")
M = TypeVar("M")
Found = TypeVar("Found")


@final
class KeptMatrices(Generic[S, M]):
    """The matrices of one method's stages, at one of its states.

    Parameters
    ----------
    scheme
        The method's coefficients.
    make
        Makes the matrices at a state.
    factorise
        Solver with matrices, for a step times an eigenvalue of the coefficients.
    counts
        Where factorisations are counted.

    Attributes
    ----------
    stale
        Whether they are made anew before the next stages are solved.
    """

    def __init__(
        self, scheme: Collocation, make: Callable[[S], M], factorise: Callable[[M, complex], Solver],
        counts: dict[str, Any],
    ) -> None:  # fmt: skip
        self._scheme, self._make, self._factorise, self._counts = scheme, make, factorise, counts
        self._made: tuple[S, M] | None = None
        self._solvers: tuple[float, list[Solver]] | None = None
        self.stale = True

    @property
    def matrices(self) -> M:
        """Those that were made last."""
        assert self._made is not None
        return self._made[1]

    def renew(self, state: S) -> M:
        """Make the matrices those of a state."""
        self._made = state, self._make(state)
        self._solvers, self.stale = None, False
        return self._made[1]

    def solved(self, state: S, stages: Callable[[], Found]) -> Found:
        """The stages of a step from a state: once more with its own matrices where older ones do not lead to them.

        Raises
        ------
        SolveError
            The stages have no solution near by.
        """
        if self.stale:
            self.renew(state)
        try:
            return stages()
        except SolveError:
            if self._made is not None and self._made[0] is state:
                raise
            self.renew(state)
            return stages()

    def solvers(self, h: float) -> list[Solver]:
        """Solvers for the eigenvalues of the coefficients in a step of h seconds, the real one first."""
        if self._solvers is None or self._solvers[0] != h:
            real, *pairs = self._scheme.values
            self._solvers = h, [self._factorise(self.matrices, h * mu) for mu in (real.real, *pairs)]
            self._counts["factorisations"] += 1
        return self._solvers[1]

    def snapshot(self, state: S) -> Snapshot:
        """State at which the matrices were made, and the step for which they were factorised; nothing of stale ones."""
        made = None if self._made is None or self.stale else self._made[0]
        step = None if self._solvers is None or made is None else self._solvers[0]
        return {"made": parts(made), "here": made is state, "step": step}

    def restore(self, snapshot: Snapshot, state: S) -> None:
        """Make the matrices where they were made."""
        self.stale = True
        if snapshot["made"] is not None:
            self.renew(state if snapshot["here"] else like(state, snapshot["made"]))
            if snapshot["step"] is not None:
                self.solvers(snapshot["step"])
