"""`fit`: numbers of a model from its recorded motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.sensitivity.readings import reading_of
from ephs.mechanics.sensitivity.sensitivity import Sensitivity, sensitivity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import ELIMINATION, NEIGHBOUR, TINY
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError, nearest_of, no_model
from ephs.solve.result.solution import Solution
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

XTOL, FTOL, GTOL = 1e-9, 1e-12, 1e-14
"""Changes of parameters, of the sum of squares and its gradient, relative, at which a fit ends."""
POSITIVE = ("mass", "friction", "stiffness", "damping", "length", "capacity", "temperature", "conductance")
"""Numbers of a scene that are not negative unless bounds say so; so are the diagonal of an inertia, and what the
components of a system take."""


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
        The scene or system with these numbers (initial values of a system excepted).
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
        Path -> start value of the search; by default the model's own.
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
        deviations are of other names, bounds of a wrong order, or deviations not positive.
    SimulationError
        A motion could not be computed.
    """
    from scipy.optimize import least_squares

    for name, given in (("start", start), ("bounds", bounds)):
        _check_names(name, given or {}, parameters)
    for path, (least, most) in (bounds or {}).items():
        if not least < most:
            raise OptionError(f"bounds[{path!r}]", (least, most), "(least, most), the first below the second")
    if not isinstance(model, Scene | System):
        raise no_model(model)
    record = _RecordedVector(model, data, sigma or {})
    guess = {
        path: float((start or {})[path]) if path in (start or {}) else _own(model, path, run) for path in parameters
    }
    lower, upper = np.array([(bounds or {}).get(path, _bounds(model, path)) for path in parameters], dtype=float).T
    scale = np.array([abs(value) or 1.0 for value in guess.values()])
    runs = _FitRuns(model, tuple(parameters), record, run, scale)
    x0 = np.clip(np.array(list(guess.values())), lower, upper) / scale
    if record.size < x0.size:
        raise OptionError("data", f"{record.size} numbers", f"{x0.size} or more, for as many parameters")
    jacobian_of: Any = runs.jacobian
    found = least_squares(
        runs.residual, x0, jac=jacobian_of, bounds=(lower / scale, upper / scale), x_scale="jac",
        xtol=XTOL, ftol=FTOL, gtol=GTOL, max_nfev=max_evaluations,
    )  # fmt: skip
    values = dict(zip(parameters, (found.x * scale).tolist(), strict=True))
    residual, jacobian = runs.residual(found.x), runs.jacobian(found.x)
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
        model=_with(model, values),
        solution=last.solution,
        iterations=runs.count,
        converged=bool(found.success),
        message=str(found.message),
    )


@final
class _RecordedVector:
    """Recorded values as one vector."""

    def __init__(self, model: System | Scene, data: Mapping[str, "ArrayLike"], sigma: Mapping[str, float]) -> None:
        if "t" not in data or len(data) < 2:
            raise OptionError("data", sorted(data), "the times t, and a reading at least")
        self.t = np.asarray(data["t"], dtype=float)
        self.values = {name: np.asarray(values, dtype=float) for name, values in data.items() if name != "t"}
        for name, values in self.values.items():
            if values.shape[:1] != self.t.shape:
                raise OptionError(f"data[{name!r}]", values.shape, f"({self.t.size}, …): one row a time")
        if not (np.all(np.isfinite(self.t)) and np.all(np.diff(self.t) > 0.0)):
            raise OptionError("data['t']", self.t.tolist(), "ascending times in s")
        _check_names("sigma", sigma, [*self.values, "t"])
        for name, deviation in sigma.items():
            if not 0.0 < deviation < np.inf:
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
        self.count = 0
        self._last: tuple[Array, Sensitivity] | None = None

    def at(self, x: Array) -> Sensitivity:
        """The motion and its tangents."""
        if self._last is None or not np.array_equal(self._last[0], x):
            values = dict(zip(self.paths, (x * self.scale).tolist(), strict=True))
            run = dict(self.run)
            initial = {p: v for p, v in values.items() if isinstance(self.model, System) and _is_state(self.model, p)}
            if initial:
                run["initial"] = {**(run.get("initial") or {}), **initial}
            until = float(self.record.t[-1])
            model = _with(self.model, values)
            self._last = np.array(x), sensitivity(model, self.paths, until, save_at=self.record.t, **run)
            self.count += 1
        return self._last[1]

    def residual(self, x: Array) -> Array:
        """Computed less recorded, weighted."""
        return self.record.vector(self.at(x).solution) - self.record.recorded

    def jacobian(self, x: Array) -> Array:
        """Its derivative by the scaled parameters."""
        return self.at(x).of(self.record.vector) * self.scale


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


def _is_state(system: System, path: str) -> bool:
    return path.partition("[")[0] in {str(slot.path) for slot in system.descriptor().states}


def _own(model: System | Scene, path: str, run: Mapping[str, Any]) -> float:
    if isinstance(model, System) and _is_state(model, path):
        stem, _, entry = path.partition("[")
        given = model.state(run.get("initial"))
        return float(
            next(value for key, value in given.items() if str(key) == stem)[int(entry[:-1] or 0) if entry else 0]
        )
    return read(model, path)


def _with(model: System | Scene, values: Mapping[str, float]) -> System | Scene:
    if isinstance(model, Scene):
        return varied(model, values, strict=False)
    return varied(model, {path: value for path, value in values.items() if not _is_state(model, path)})


def _bounds(model: System | Scene, path: str) -> tuple[float, float]:
    """The bounds of a number that none are given for."""
    if isinstance(model, System):
        return (-np.inf if _is_state(model, path) else 0.0), np.inf
    stem, _, entry = path.partition("[")
    key = stem.rpartition(".")[2]
    moment = key == "inertia" and entry[:1] in ("0", "1", "2")
    return (0.0 if key in POSITIVE or moment else -np.inf), np.inf
