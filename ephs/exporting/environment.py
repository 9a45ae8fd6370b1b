"""Environments of gymnasium: a scene as a task of control, one or many on threads."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, final

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ephs.exporting.image import image_of
from ephs.exporting.module import Exported, exported
from ephs.mechanics.runs.signals import numbers_of
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import varied
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage.objects import compiled
from ephs.solve.posing.errors import OptionError, count_of, number_of
from ephs.solve.running.control import RTOL

# Exported mechanisms running in this process: many instances with separate memory.

_POINTER: Final = ctypes.c_void_p
_CALLS: Final[dict[str, tuple[Any, ...]]] = {
    "start": (None, _POINTER),
    "parameters": (None, _POINTER, _POINTER),
    "inputs": (None, _POINTER, _POINTER),
    "advance": (ctypes.c_int64, _POINTER, ctypes.c_double),
    "time": (ctypes.c_double, _POINTER),
    "outputs": (ctypes.c_int64, _POINTER, _POINTER),
    "accelerations": (ctypes.c_int64, _POINTER, _POINTER),
}
"""Results and arguments of the functions of an exported mechanism."""


@final
class Instances:
    """A number of instances of one mechanism.

    Parameters
    ----------
    made
        The mechanism.
    count
        Number of instances. Different ones may be advanced by different threads at once.

    Attributes
    ----------
    inputs, outputs
        (count, ·) forces that act, and what was read last.
    """

    def __init__(self, made: Exported, count: int = 1) -> None:
        self.made, self.count = made, count
        self._library = compiled(made.text)
        self._memory = np.zeros((count, made.bytes // 8))
        self.inputs = np.tile([each.start for each in made.inputs], (count, 1)).reshape(count, -1)
        self.outputs = np.zeros((count, len(made.outputs)))
        self._calls = {
            name: ctypes.CFUNCTYPE(result, *arguments)(self._library.address(f"{made.name}_{name}"))
            for name, (result, *arguments) in _CALLS.items()
        }
        self._memories = [row.ctypes.data for row in self._memory]
        self._forces = [row.ctypes.data for row in self.inputs]
        self._values = [row.ctypes.data for row in self.outputs]
        for number in range(count):
            self.start(number)

    def start(self, number: int = 0, parameters: Array | None = None) -> None:
        """Begin at the initial state; ``parameters`` override the model's."""
        self._calls["start"](self._memories[number])
        if parameters is not None:
            given = np.ascontiguousarray(parameters, dtype=np.float64)
            self._calls["parameters"](self._memories[number], given.ctypes.data)
        self.inputs[number] = [each.start for each in self.made.inputs]

    def advance(self, until: float, number: int = 0) -> int:
        """Take steps to a time in s under `inputs`, and read the outputs; 0, or the status of a failed step."""
        memory = self._memories[number]
        self._calls["inputs"](memory, self._forces[number])
        return int(self._calls["advance"](memory, until)) or self.read(number)

    def read(self, number: int = 0) -> int:
        """Read the outputs; 0, or a status."""
        return int(self._calls["outputs"](self._memories[number], self._values[number]))

    def time(self, number: int = 0) -> float:
        """Time in s."""
        return float(self._calls["time"](self._memories[number]))

    def accelerations(self, number: int = 0) -> Array:
        """Accelerations of the joints of the spanning tree.

        Raises
        ------
        ArithmeticError
            They cannot be evaluated; with the status that the header explains.
        """
        values = np.zeros(self.made.accelerations)
        if status := int(self._calls["accelerations"](self._memories[number], values.ctypes.data)):
            raise ArithmeticError(status)
        return values


CHUNK: Final = 8
"""Least number of instances per thread: with fewer, scheduling costs more than computing."""


@final
class EnvironmentTask:
    """A scene, its actions, observations, and task.

    Parameters
    ----------
    inputs
        Joints that are driven, as ``joints.hip``, and actuators of the scene, as ``actuators.servo``.
    outputs
        Names of what is observed, or beginnings of such, as ``joints``.
    limits
        Largest size of an action, in N or N m for joints: one number, or one for each; by default the range of an
        actuator that has one, and 1 elsewhere.
    period
        Time in s between actions.
    reward
        Called with the observation and the action.
    done
        Called with the observation: whether an episode ends there.
    horizon
        Actions of an episode.
    parameters
        Ranges of numbers of the model from which each episode draws, by path.
    method, rtol, step
        As of `ephs.export`.

    Attributes
    ----------
    made
        The mechanism as a program.
    names
        Of the observed numbers.

    Raises
    ------
    ExportError
        The scene, an input, an output or a parameter does not allow it.
    OptionError
        An option is no number, no function or no range.
    SceneError
        An end of a range is no number for its parameter.
    """

    def __init__(
        self, scene: Scene, *, inputs: Sequence[str], reward: Callable[[Array, Array], float],
        outputs: Sequence[str] = ("joints",), limits: float | Sequence[float] | None = None, period: float = 0.02,
        done: Callable[[Array], bool] = lambda _: False, horizon: int = 500,
        parameters: Mapping[str, tuple[float, float]] | None = None, method: str = "rk54", rtol: float = RTOL,
        step: float | None = None,
    ) -> None:  # fmt: skip
        for key, function in (("reward", reward), ("done", done)):
            if not callable(function):
                raise OptionError(key, function, "a function")
        self.reward, self.done, self.horizon = reward, done, count_of("horizon", horizon)
        self.period = number_of("period", period)
        if not 0.0 < self.period < np.inf:
            raise OptionError("period", period, "a number of seconds > 0")
        if not isinstance(parameters, Mapping | None):
            raise OptionError("parameters", parameters, "paths with ranges (least, most)")
        ranges = {path: numbers_of(pair) for path, pair in (parameters or {}).items()}
        for path, pair in ranges.items():
            if pair is None or pair.shape != (2,) or not (np.isfinite(pair).all() and pair[0] <= pair[1]):
                raise OptionError(f"parameters[{path!r}]", (parameters or {})[path], "(least, most)")
            for end in pair.tolist():
                varied(scene, {path: end})
        self.ranges = np.array(list(ranges.values())).reshape(-1, 2)
        image = image_of(
            scene, inputs=inputs, parameters=list(parameters or {}), method=method, rtol=rtol, step=step,
            until=self.period * self.horizon,
        )  # fmt: skip
        self.made: Exported = exported(image, "task")
        seen = self.made.chosen(outputs)
        self.names = tuple(each.name for each in seen)
        self.places = np.array([each.place for each in seen], dtype=int)
        if limits is None:
            low, high = np.array([each.limits for each in self.made.inputs], dtype=float).reshape(-1, 2).T
            low, high = np.where(np.isfinite(low), low, -1.0), np.where(np.isfinite(high), high, 1.0)
        else:
            sizes, count = numbers_of(limits), len(self.made.inputs)
            if sizes is None or sizes.shape not in ((1,), (count,)) or not np.all(sizes > 0.0):
                raise OptionError("limits", limits, f"a number > 0, or {count}, one for each input")
            high = np.broadcast_to(sizes, (count,)).copy()
            low = -high
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (len(seen),), dtype=np.float64)

    def drawn(self, rng: np.random.Generator) -> Array | None:
        """Parameters of an episode."""
        return rng.uniform(self.ranges[:, 0], self.ranges[:, 1]) if len(self.ranges) else None


@final
class Environment(gymnasium.Env[Array, Array]):
    """One environment: actions are forces on the inputs, constant over a period, in place of the scene's drives there.

    An episode whose steps fail ends, and says why in ``info["status"]``.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - gymnasium's own

    def __init__(self, task: EnvironmentTask) -> None:
        self.task = task
        self.action_space, self.observation_space = task.action_space, task.observation_space
        self._run, self._count = Instances(task.made), 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode."""
        super().reset(seed=seed)
        self._run.start(0, self.task.drawn(self.np_random))
        self._count = 0
        self._run.read()
        return self._run.outputs[0, self.task.places], {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Take a period under an action."""
        task = self.task
        self._run.inputs[0] = np.clip(action, task.action_space.low, task.action_space.high)
        self._count += 1
        status = self._run.advance(task.period * self._count)
        seen = self._run.outputs[0, task.places]
        ended = bool(status) or task.done(seen)
        return seen, float(task.reward(seen, action)), ended, self._count >= task.horizon, {"status": status}


@final
class Environments(VectorEnv[Array, Array, Any]):
    """Environments of one task, stepped by threads. A finished episode restarts at the next step."""

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - gymnasium's own

    def __init__(self, task: EnvironmentTask, count: int, threads: int = 1) -> None:
        self.task, self.num_envs = task, count
        self.single_action_space, self.single_observation_space = task.action_space, task.observation_space
        self.action_space = batch_space(task.action_space, count)
        self.observation_space = batch_space(task.observation_space, count)
        self._run, self._counts = Instances(task.made, count), np.zeros(count, dtype=int)
        self._over = np.zeros(count, dtype=bool)
        self._status = np.zeros(count, dtype=np.int64)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._random = [np_random()[0] for _ in range(count)]

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin all episodes. Each environment draws as one alone with its seed, the k-th of one seed with seed + k;
        without a seed they draw on."""
        seeds = (
            seed if isinstance(seed, Sequence) else [None if seed is None else seed + k for k in range(self.num_envs)]
        )
        if len(seeds) != self.num_envs:
            raise OptionError("seed", seed, f"one number, or {self.num_envs}")
        self._random = [r if each is None else np_random(each)[0] for r, each in zip(self._random, seeds, strict=True)]
        for number in range(self.num_envs):
            self._begin(number)
        self._over[:] = False
        return self._run.outputs[:, self.task.places], {}

    def _begin(self, number: int) -> None:
        self._run.start(number, self.task.drawn(self._random[number]))
        self._counts[number] = self._status[number] = 0
        self._run.read(number)

    def step(self, actions: Array) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """Take a period in all episodes under actions (count, ·)."""
        task, going = self.task, ~self._over
        for number in np.flatnonzero(self._over).tolist():
            self._begin(number)
        self._run.inputs[going] = np.clip(actions, task.action_space.low, task.action_space.high)[going]
        self._counts[going] += 1
        numbers = np.flatnonzero(going).tolist()
        chunks = [numbers[k : k + CHUNK] for k in range(0, len(numbers), CHUNK)]
        list(map(self._advance, chunks) if self._pool is None else self._pool.map(self._advance, chunks))
        seen = self._run.outputs[:, task.places]
        rewards = np.array([task.reward(x, u) for x, u in zip(seen, actions, strict=True)]) * going
        ended = going & ((self._status != 0) | np.array([task.done(x) for x in seen]))
        cut = going & (self._counts >= task.horizon)
        self._over = ended | cut
        return seen, rewards, ended, cut, {"status": self._status.copy()}

    def _advance(self, numbers: Sequence[int]) -> None:
        for number in numbers:
            self._status[number] = self._run.advance(self.task.period * int(self._counts[number]), number)

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
