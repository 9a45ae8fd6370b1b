"""`fit`: numbers of a model from its recorded motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.runs.signals import check_mappings, check_options, numbers_of
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.sensitivity.family import check_paths
from ephs.mechanics.sensitivity.readings import reading_of
from ephs.mechanics.sensitivity.sensitivity import Sensitivity, sensitivity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import ELIMINATION, NEIGHBOUR, TINY
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import (
    OptionError,
    Outcome,
    SimulationError,
    count_of,
    nearest_of,
    no_model,
    number_of,
)
from ephs.solve.result.solution import Solution
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

XTOL, FTOL, GTOL = 1e-9, 1e-12, float(np.finfo(float).eps)
"""Changes of parameters and of the sum of squares, relative, and gradients, as of `LARGE` records, that end a fit."""
LARGE = 2.0**20
"""The record's norm in a fit, so that of all gradients zero alone is below `GTOL`, which SciPy takes absolutely."""
FIRST = 1e-6
"""Part of the residual by which a number that starts at zero changes it at once: SciPy's first steps are as large."""
UNSEEN = 1e-12
"""Change of readings, relative to the record, that is rounding if a number changes by its own size."""
OPTIONS = ("method", "step", "rtol", "atol", "t0", "initial", "inputs", "reference")
"""Options of `sensitivity` that a fit takes."""
POSITIVE = ("mass", "friction", "stiffness", "damping", "length", "capacity", "temperature", "conductance")
"""Numbers of a scene that are not negative unless bounds say so; so are the diagonal of an inertia, and what the
components of a system take."""

ELSEWHERE = (Outcome.INTERRUPTED, Outcome.MEMORY, Outcome.PYTHON)
"""Ends of runs that other parameters do not mend."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Parameters of a model fitted to its recorded motion.

    Parameters
    ----------
    values, errors
        Path -> number, and its standard error; the error is infinite where the record does not determine it.
    covariance
        (p, p) in the order of ``values``.
    residuals
        Reading -> recorded less computed, in the shape of the record.
    deviation
        The residuals' standard deviation, in units of ``sigma``.
    model
        The scene or system with these numbers.
    solution
        Its motion at the times of the record.
    iterations
        How many motions were computed.
    converged
        Whether least squares ended where it could not improve; ``message`` is what ended it.
    """

    values: Mapping[str, float]
    errors: Mapping[str, float]
    covariance: Array
    residuals: Mapping[str, Array]
    deviation: float
    model: System | Scene
    solution: Solution
    iterations: int
    converged: bool
    message: str

    def __str__(self) -> str:
        lines = [f"fit of {len(self.values)} numbers, residuals of {self.deviation:.3g}: {self.message}"]
        lines += [f"  {path} = {value:.9g} ± {self.errors[path]:.2g}" for path, value in self.values.items()]
        return "\n".join(lines)


@in_one_thread
def fit(
    model: System | Scene,
    data: Mapping[str, "ArrayLike"],
    parameters: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    sigma: Mapping[str, float] | None = None,
    max_evaluations: int = 100,
    **run: Any,
) -> Fit:
    """Fit numbers of a model to a recorded motion, by least squares with exact tangents.

    Parameters
    ----------
    data
        ``"t"``: (n,) times in s; and name -> (n,) or (n, d) recorded signals, by the names of
        `ephs.mechanics.sensitivity.readings`: ``joints.pin.coordinate``, ``bodies.rod.position``,
        ``markers.tip.position``, ``osc.pe.q``. NaN marks missing entries.
    parameters
        Paths, as for `sensitivity`, including initial values.
    start
        Path -> start value of the search, within its bounds; by default the model's own, or the nearest in bounds.
    bounds
        Path -> (least, most). By default masses, friction, stiffness, moments of inertia and the like, and all
        parameters of a system's components, are not negative.
    sigma
        Signal -> standard deviation of its noise, 1 by default; the inverses are weights of the residuals.
    max_evaluations
        Largest number of computed motions.
    **run
        Options of `sensitivity`: method, step, rtol, atol, t0, initial, inputs, reference.

    Raises
    ------
    OptionError
        A record does not fit its reading, or there are fewer numbers in it than parameters; start values, bounds or
        deviations are of other names, or no numbers, bounds of a wrong order, start values beyond them, or deviations
        not positive.
    SimulationError
        The motion at the start values could not be computed; where others cannot, the search takes shorter ways.
    """
    from scipy.optimize import least_squares

    check_options(run, OPTIONS)
    check_mappings(start=start, bounds=bounds, sigma=sigma, initial=run.get("initial"), inputs=run.get("inputs"))
    check_paths(parameters)
    for name, given in (("start", start), ("bounds", bounds)):
        _check_names(name, given or {}, parameters)
    limits = {path: numbers_of(pair) for path, pair in (bounds or {}).items()}
    for path, pair in limits.items():
        if pair is None or pair.shape != (2,) or not pair[0] < pair[1]:
            raise OptionError(f"bounds[{path!r}]", (bounds or {})[path], "(least, most), the first below the second")
    if not isinstance(model, Scene | System):
        raise no_model(model)
    if isinstance(model, System):
        model = model.with_initial(run.pop("initial", None) or {})
    record = _RecordedVector(model, data, sigma or {}, number_of("t0", run.get("t0", 0.0)))
    evaluations = count_of("max_evaluations", max_evaluations)
    lower, upper = np.array([limits.get(path, _bounds(model, path)) for path in parameters], dtype=float).T
    guess = np.clip([read(model, path) for path in parameters], lower, upper)
    for i, path in enumerate(parameters):
        if path in (start or {}):
            expected = f"a number within [{lower[i]:g}, {upper[i]:g}]"
            guess[i] = number_of(f"start[{path!r}]", (start or {})[path], expected)
            if not (np.isfinite(guess[i]) and lower[i] <= guess[i] <= upper[i]):
                raise OptionError(f"start[{path!r}]", guess[i], expected)
    if record.size < guess.size:
        raise OptionError("data", f"{record.size} numbers", f"{guess.size} or more, for as many parameters")
    scale = np.where(guess, np.abs(guess), 1.0)
    runs = _FitRuns(model, tuple(parameters), record, run, scale)
    x0 = guess / scale
    off = float(np.linalg.norm(runs.residual(x0)))
    runs.gain = LARGE / (max(off, float(np.linalg.norm(record.recorded))) or LARGE)
    seen, room = np.linalg.norm(runs.jacobian(x0), axis=0), np.where(upper > 0.0, upper, lower) / scale
    first = FIRST * runs.gain * off / np.where(seen, seen, np.inf)
    x0 = np.where(x0, x0, np.sign(room) * np.fmin(first, 0.5 * np.abs(room)))
    jacobian_of: Any = runs.jacobian
    runs.at(x0)  # whose motion there has to be
    found = least_squares(
        runs.tried, x0, jac=jacobian_of, bounds=(lower / scale, upper / scale), x_scale="jac",
        xtol=XTOL, ftol=FTOL, gtol=GTOL, max_nfev=evaluations,
    )  # fmt: skip
    values = dict(zip(parameters, (found.x * scale).tolist(), strict=True))
    residual, jacobian = (each(found.x) / runs.gain for each in (runs.residual, runs.jacobian))
    freedom = max(1, record.size - x0.size)
    deviation = float(np.sqrt(residual @ residual / freedom))
    covariance, errors = _covariance(jacobian / scale, deviation)
    last = runs.at(found.x)
    return Fit(
        values=values,
        errors=dict(zip(parameters, errors.tolist(), strict=True)),
        covariance=covariance,
        residuals=record.residuals(last.solution),
        deviation=deviation,
        model=varied(model, values, strict=False),
        solution=last.solution,
        iterations=runs.count,
        converged=bool(found.success),
        message=str(found.message),
    )


@final
class _RecordedVector:
    """Recorded values as one vector."""

    def __init__(
        self, model: System | Scene, data: Mapping[str, "ArrayLike"], sigma: Mapping[str, float], t0: float
    ) -> None:
        if not isinstance(data, Mapping) or "t" not in data or len(data) < 2:
            found = sorted(map(str, data)) if isinstance(data, Mapping) else type(data).__name__
            raise OptionError("data", found, "the times t, and a reading at least, by name")
        found = {name: numbers_of(values) for name, values in data.items()}
        for name, values in found.items():
            if values is None or np.any(np.isinf(values)):
                raise OptionError(f"data[{name!r}]", data[name], "finite numbers, or NaN for missing ones")
        self.values: dict[str, Array] = {name: np.asarray(values) for name, values in found.items()}
        self.t = self.values.pop("t")
        ascending = self.t.ndim == 1 and self.t.size and np.all(np.diff(self.t) > 0.0)
        if not (ascending and t0 <= self.t[0] and t0 < self.t[-1] < np.inf):
            raise OptionError("data['t']", self.t.tolist(), f"ascending times in s, from t0 = {t0:g} s on")
        for name, values in self.values.items():
            if values.shape[:1] != self.t.shape:
                raise OptionError(f"data[{name!r}]", values.shape, f"({self.t.size}, …): one row a time")
        _check_names("sigma", sigma, [*self.values, "t"])
        for name, deviation in sigma.items():
            if not 0.0 < number_of(f"sigma[{name!r}]", deviation, "a number > 0") < np.inf:
                raise OptionError(f"sigma[{name!r}]", deviation, "a number > 0")
        self._readings = {name: reading_of(model, name) for name in self.values}
        self.kept = {name: np.isfinite(values) for name, values in self.values.items()}
        self.size = int(sum(kept.sum() for kept in self.kept.values()))
        self._weights = {name: 1.0 / float(sigma.get(name, 1.0)) for name in self.values}

    def vector(self, solution: Solution) -> Array:
        """The computed readings, weighted."""
        return np.concatenate(
            [self._read(solution, name)[kept] * self._weights[name] for name, kept in self.kept.items()]
        )

    @property
    def recorded(self) -> Array:
        """The same of the record."""
        return np.concatenate([self.values[name][kept] * self._weights[name] for name, kept in self.kept.items()])

    def residuals(self, solution: Solution) -> dict[str, Array]:
        """Recorded less computed."""
        return {name: values - self._read(solution, name) for name, values in self.values.items()}

    def _read(self, solution: Solution, name: str) -> Array:
        found, wanted = self._readings[name](solution), self.values[name].shape
        if found.shape != wanted and found.size != self.values[name].size:
            raise OptionError(f"data[{name!r}]", wanted, f"{found.shape}")
        return found.reshape(wanted)


def _check_names(option: str, given: Mapping[str, object], known: Sequence[str]) -> None:
    """Refuse numbers of names that a fit does not have, which would change nothing."""
    for name in given:
        if name not in known:
            raise OptionError(f"{option}[{name!r}]", given[name], f"one of {', '.join(known)}{nearest_of(name, known)}")


@final
class _FitRuns:
    """Motions by parameters, the last one kept: its residuals and their derivative are wanted one after the other."""

    def __init__(
        self,
        model: System | Scene,
        paths: tuple[str, ...],
        record: _RecordedVector,
        run: Mapping[str, Any],
        scale: Array,
    ) -> None:
        self.model, self.paths, self.record, self.run, self.scale = model, paths, record, dict(run), scale
        self.count, self.gain = 0, 1.0
        self._last: tuple[Array, Sensitivity] | None = None

    def at(self, x: Array) -> Sensitivity:
        """The motion and its tangents."""
        if self._last is None or not np.array_equal(self._last[0], x):
            values = dict(zip(self.paths, (x * self.scale).tolist(), strict=True))
            model, until = varied(self.model, values, strict=False), float(self.record.t[-1])
            self._last = np.array(x), sensitivity(model, self.paths, until, save_at=self.record.t, **self.run)
            self.count += 1
        return self._last[1]

    def residual(self, x: Array) -> Array:
        """Computed less recorded, weighted, times the gain."""
        return (self.record.vector(self.at(x).solution) - self.record.recorded) * self.gain

    def tried(self, x: Array) -> Array:
        """The same, NaN where there is no motion, for which SciPy goes a shorter way."""
        try:
            return self.residual(x)
        except SimulationError as error:
            if error.outcome in ELSEWHERE:
                raise
            return np.full(self.record.size, np.nan)

    def jacobian(self, x: Array) -> Array:
        """Its derivative by the scaled parameters, zero where it is rounding."""
        out = self.at(x).of(self.record.vector) * self.scale * self.gain
        unseen = np.linalg.norm(out, axis=0) * np.maximum(np.abs(x), 1.0) < UNSEEN * LARGE
        return np.where(unseen, 0.0, out)


def _covariance(jacobian: Array, deviation: float) -> tuple[Array, Array]:
    """Covariance of the parameters, and standard errors; infinite along what the record does not determine."""
    size = np.maximum(np.linalg.norm(jacobian, axis=0), TINY)
    _, sigma, vt = svd(jacobian / size, full_matrices=False)
    seen = sigma > ELIMINATION * sigma.max(initial=0.0)
    half = (vt[seen].T / sigma[seen]) / size[:, None]
    covariance = deviation**2 * half @ half.T
    lost = np.abs(vt[~seen]).max(axis=0, initial=0.0) > NEIGHBOUR
    covariance[lost, lost] = np.inf
    return covariance, np.sqrt(np.diag(covariance))


def _bounds(model: System | Scene, path: str) -> tuple[float, float]:
    """The bounds of a number that none are given for."""
    if isinstance(model, System):
        return (-np.inf if path.partition("[")[0] in map(str, model.states) else 0.0), np.inf
    stem, _, entry = path.partition("[")
    key = stem.rpartition(".")[2]
    moment = key == "inertia" and entry[:1] in ("0", "1", "2")
    return (0.0 if key in POSITIVE or moment else -np.inf), np.inf
