"""Findings of the audit of a run, and the policies for runs that do not pass."""

import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, final

from ephs.solve.posing.errors import Outcome, SimulationError

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

POLICIES = ("fail", "warn", "off")
"""Policies for findings: an error, a warning, an entry in the summary."""


@final
@dataclass(frozen=True, slots=True)
class Finding:
    """A law that a run breaks.

    Parameters
    ----------
    law
        A name in `ephs.solve.auditing.audit.LAWS`.
    size, allowed
        By how much it is broken, and how much is allowed; relative, see the law.
    at
        The time in s.
    path
        The component where that shows most; empty where no single one can be named.
    advice
        What to do.
    """

    law: str
    size: float
    allowed: float
    at: float
    path: str
    advice: str

    def __str__(self) -> str:
        where = f" at {self.path}" if self.path else ""
        when = f"t = {self.at:.6g} s"
        return f"{self.law}: {self.size:.2g} where {self.allowed:.2g} is allowed, {when}{where}; {self.advice}"


@final
@dataclass(frozen=True, slots=True)
class Audit:
    """Findings of the audit of a run."""

    findings: tuple[Finding, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every law is kept."""
        return not self.findings

    def record(self) -> dict[str, Any]:
        """Entry of ``summary.json``."""
        return {"passed": self.passed, "findings": [asdict(finding) for finding in self.findings]}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Audit":
        """From a value of `record`."""
        return cls(tuple(Finding(**finding) for finding in record["findings"]))

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "passed"


@final
class AuditWarning(UserWarning):
    """A run that violates a law of its audit."""


@final
class CostWarning(UserWarning):
    """Forecast that a run will be long, from its first steps, with faster methods."""


@final
class AuditError(SimulationError):
    """A complete run that violates a law.

    Attributes
    ----------
    findings
        The violated laws.
    partial
        The whole solution.
    """

    def __init__(self, found: Audit, partial: "Solution") -> None:
        first = found.findings[0]
        super().__init__(Outcome.UNLAWFUL, first.at, first.path, "; ".join(map(str, found.findings)), partial)
        self.findings = found.findings

    def __reduce__(self) -> tuple[object, ...]:
        return (AuditError, (Audit(self.findings), self.partial))


def judged(solution: "Solution", policy: str) -> "Solution":
    """The solution of a run, by a policy of `POLICIES`.

    Raises
    ------
    AuditError
        It breaks a law, and the policy is ``"fail"``.
    """
    if policy == "off" or (found := solution.audit).passed:
        return solution
    if policy == "fail":
        raise AuditError(found, solution)
    for finding in found.findings:
        warnings.warn(f"{solution.name}: {finding}", AuditWarning, stacklevel=4)
    return solution
