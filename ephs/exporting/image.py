"""One mechanism's run as functions in machine code and the arrays of their arguments."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Annotated, Any, final

import numpy as np

from ephs.exporting.errors import ExportError
from ephs.exporting.parameters import ParameterPolynomial, dependence
from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.simulate import control_of
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.build import component_path, tension_port
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.tree.engine.heats import entropies
from ephs.mechanics.tree.engine.states import Ends, Source, StorageRow, Walked, energies, rows
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.sweeps.acting import Tables, Work
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.linear.dense import copy
from ephs.semantics.spaces import codes
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Table,
    Vector,
)
from ephs.semantics.stage.calling import Bound
from ephs.semantics.systems.system import System
from ephs.solve.march.control import Proportional
from ephs.solve.march.records import MarchControl
from ephs.solve.posing.errors import OptionError, number_of
from ephs.solve.posing.problem import Problem
from ephs.solve.running.control import ATOL, RTOL, first_step
from ephs.solve.running.stepping import Span

# The program that reads a mechanism's state: coordinates, rates, poses of bodies, energy.


def _row(x: Vector) -> Matrix:
    return Matrix(x.cells, x.start, 1, x.size)


def _read(
    on: Evaluator, tables: Tables, work: Work, bodies: Table[Walked], springs: Table[Ends], plan: Table[Source],
    poses: Annotated[Matrix, 7], twists: Annotated[Matrix, 6], storages: Table[StorageRow], reads: Integers,
    parameters: Vector, turning: Integers, momentum: Vector, s: Matrix, x: Matrix, stored: Matrix, q: Vector, y: Vector,
    out: Vector,
) -> Integer:  # fmt: skip
    """Write (q, r, poses of bodies, energy in J) at a state to ``out``; return a status."""
    increments, freedoms, nodes = tables.drive.size, work.force.size, tables.node.size
    r = y.part(increments, freedoms)
    status = on.counter(0)
    status.value = entropies(on, tables, work, y.part(increments + freedoms, nodes))
    copy(on, work.entropy.part(0, nodes), s.row(0))

    def turn(k: Integer) -> None:
        s[0, nodes + k] = r[turning[k]] * momentum[k]

    on.loop(turning.size, turn)
    rows(on, bodies, springs, plan, _row(q), _row(r), s, poses, twists, x)

    def store() -> None:
        status.value = energies(
            on, storages, reads, parameters, tables.scal, x, work.x, work.v, work.e, work.lam, work.f, work.c, work.jac,
            work.scratch, stored, work.fault,
        )  # fmt: skip

    on.when(on.same(status.value, 0), store)
    copy(on, q, out.part(0, q.size))
    copy(on, r, out.part(q.size, freedoms))
    first = q.size + freedoms

    def pose(i: Integer) -> None:
        copy(on, poses.row(i), out.part(first + 7 * i, 7))

    on.loop(bodies.size, pose)
    total = on.variable(0.0)

    def add(k: Integer) -> None:
        total.value = total.value + stored[0, k]

    on.loop(stored.columns, add)
    out[first + 7 * bodies.size] = total.value
    return status.value


@cache
def outputs_program() -> Program:
    """Return the program."""
    return Program("outputs", read=Entry(_read))


METHODS = ("rk54", "rk87")
POSE = tuple(f"quaternion.{part}" for part in "wxyz") + tuple(f"position.{part}" for part in "xyz")
"""Names of the numbers of a pose, those of a rotation first."""
MEMORY = ("poses", "twists", "s", "stored", "out")
"""Arrays that evaluations write."""


@final
@dataclass(frozen=True, slots=True)
class Share:
    """Contribution of an input to the arrays of a run: ``ratio`` times its value, at a place of the joint forces or,
    with ``supplied``, of the supplies of attachments, such as tensions of tendons."""

    supplied: bool
    place: int
    ratio: float


@final
@dataclass(frozen=True, slots=True)
class ImageNumber:
    """An input or output number.

    Attributes
    ----------
    place
        Of an output or a parameter: its place among them.
    start
        Its value at the start.
    shares, limits
        Of an input: what it adds, and the range within which it does.
    """

    name: str
    unit: str
    place: int
    start: float
    shares: tuple[Share, ...] = ()
    limits: tuple[float, float] = (-math.inf, math.inf)

    def clipped(self, value: float) -> float:
        """A value within the limits."""
        return min(max(value, self.limits[0]), self.limits[1])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """A run at its start.

    Attributes
    ----------
    march, read, rates
        Calls with all their arrays: many steps, outputs, rates of change of the state.
    control
        What chooses the steps.
    drive, supply
        (forces,) given forces on joints, and what is supplied to attachments.
    q, y
        The state in the memory of the march.
    out
        The array that `read` writes.
    numbers, dependences
        The arrays that determine the run, and which of their numbers depend on the parameters.
    acceleration
        The array that `rates` writes, and where the accelerations of the tree's joints start and how many there are.
    """

    name: str
    march: Bound
    read: Bound
    rates: Bound
    control: Table[MarchControl]
    drive: Array
    supply: Array
    out: Array
    acceleration: tuple[Array, int, int]
    inputs: tuple[ImageNumber, ...]
    outputs: tuple[ImageNumber, ...]
    parameters: tuple[ImageNumber, ...]
    numbers: tuple[Array, ...]
    dependences: tuple[ParameterPolynomial, ...]


def image_of(
    model: Scene | System, *, inputs: Sequence[str] = (), parameters: Sequence[str] = (), method: str = "rk87",
    rtol: float = RTOL, atol: float = ATOL, step: float | None = None, until: float = 10.0,
) -> Image:  # fmt: skip
    """Return the run of a model from its initial state.

    Parameters
    ----------
    inputs
        Names of joints, as ``joints.pin``, on whose free coordinates a force or torque is given from outside, and of
        the scene's actuators, as ``actuators.servo``, whose controls are.
    parameters
        Paths of numbers of the model that may be changed, as of `ephs.sweep`.
    until
        Time in s over which errors are to stay within the tolerances.

    Raises
    ------
    ExportError
        The method has constant memory of another kind, an input has no place, or a contact or stop is hard.
    OptionError
        An option is no number, or no list of names.
    """
    if method not in METHODS:
        raise ExportError("method", found=method, expected=" or ".join(METHODS))
    for key, paths in (("inputs", inputs), ("parameters", parameters)):
        listed = isinstance(paths, Sequence) and not isinstance(paths, str)
        if not listed or not all(isinstance(path, str) for path in paths) or len(set(paths)) < len(paths):
            raise OptionError(key, paths, "names, each once, as a list")
    if not 0.0 < number_of("until", until) < math.inf:
        raise OptionError("until", until, "a number of seconds > 0")
    started = partial(_started, inputs=inputs, method=method, steps=(rtol, atol, step), until=until)
    found = started(model)
    for path in parameters:
        for name in inputs:
            if name.startswith("actuators.") and path.startswith(f"{name}."):
                raise ExportError("input parameter", found=path, where=name)
    if not parameters:
        return found
    start = {path: read(model, path) for path in parameters}
    dependences = dependence(start, lambda values: started(varied(model, values, strict=False)).numbers)
    for each in dependences:
        _keep_apart(found, each, parameters)
    variables = tuple(ImageNumber(path, "", k, value) for k, (path, value) in enumerate(start.items()))
    return replace(found, parameters=variables, dependences=tuple(dependences))


def _keep_apart(image: Image, number: ParameterPolynomial, parameters: Sequence[str]) -> None:
    """Refuse a parameter that moves what an input sets."""
    arrays = {id(image.drive): False, id(image.supply): True}
    supplied, moved = arrays.get(id(image.numbers[number.array])), {i for key in number.terms for i in key}
    for each in image.inputs:
        if moved and (supplied, number.entry) in {(share.supplied, share.place) for share in each.shares}:
            raise ExportError("input parameter", found=parameters[min(moved)], where=each.name)


def _started(
    model: Scene | System, inputs: Sequence[str], method: str, steps: tuple[float, float, float | None], until: float
) -> Image:
    """Return the run without parameters."""
    rtol, atol, step = steps
    if isinstance(model, Scene):
        known = [*(f"joints.{name}" for name in model.joints), *_actuators(model)]
        for name in inputs:
            if name not in known:
                raise ExportError("input", found=name, expected=", ".join(known))
        sizes = {f"joints.{name}": joint.dim for name, joint in model.joints.items()}
        zeros = {name: np.zeros(sizes[name]) if sizes.get(name, 1) > 1 else 0.0 for name in inputs}
        problem = problem_of_scene(model, None, zeros)
    else:
        problem = problem_of_system(model)
    if (hard := problem.descriptor.strikes) is not None:
        raise ExportError("impacts", where=hard)
    for path, signal in problem.signals.items():
        if not signal.constant:
            raise ExportError("function", where=path)
    equations = ReducedEquations(problem, 0.0)
    control = control_of(problem, tableau(method).order, rtol, atol, step, None, None, None)
    explicit = Explicit(equations, control, tableau(method))
    policy = None if step is not None else Proportional(explicit)
    start = equations.start(0.0)
    leg = explicit.many(Span(start, 0.0, until, first_step(control, until), control, policy, np.zeros(0), 0))
    if leg is None:
        raise ExportError("python", where=problem.name)
    return _image(problem, equations, leg, _inputs(equations, model, inputs))


def _image(problem: Problem, eq: ReducedEquations, leg: Any, inputs: Sequence[ImageNumber]) -> Image:
    memory, control = leg.memory, leg.steering
    reduced = eq.reduced
    out = np.zeros(reduced.coordinates + eq.n + 7 * reduced.links + 1)
    state = leg.state
    eq.row(state)  # which of a pose's two quaternions is meant
    model, (turning, momentum) = eq.model.tables, eq.booking.paper.inertias()
    parts = {
        "tables": eq.engine.tables, "work": eq.engine.work, **eq.booking.paper.parts(),
        "storages": eq.booking.storages, "reads": model.read_x, "parameters": np.array(model.parameters),
        "turning": turning, "momentum": momentum, "s": np.zeros((1, eq.ns + turning.size)),
        "x": np.array(eq.booking.paper.rest[None]),
        "stored": np.zeros((1, len(problem.descriptor.components))), "q": memory["q"], "y": memory["y"], "out": out,
    }  # fmt: skip
    read = outputs_program().compiled()["read"].bind(*parts.values())
    change = np.zeros(eq.size)
    rates = eq.engine.bind("rates", memory["q"], memory["y"], np.zeros(reduced.coordinates), change)
    found = int(read())
    if found:
        eq.refuse(found, eq.engine.failed)
    return Image(
        problem.name, leg.march, read, rates, control, eq.drive, eq.given.supply, out, (change, eq.nv, eq.n),
        tuple(inputs), tuple(_outputs(eq, out)), (), tuple(_numbers(parts)), (),
    )  # fmt: skip


def _numbers(parts: Mapping[str, Any]) -> Iterator[Array]:
    """Yield the arrays of real numbers that determine a run: tables and the state, not the memory of evaluations."""
    for name, part in (*parts["tables"].items(), *parts.items()):
        if isinstance(part, Table):
            yield part.arrays[1]
        elif isinstance(part, np.ndarray) and part.dtype == np.float64 and name not in MEMORY:
            yield part


def _actuators(scene: Scene) -> dict[str, Actuator]:
    """The actuators of a scene by the names of their controls."""
    return {f"actuators.{name}": each for name, each in scene.every("actuators")}


def _inputs(eq: ReducedEquations, scene: Scene | System, names: Sequence[str]) -> list[ImageNumber]:
    t, out = eq.reduced.tables, list[ImageNumber]()
    actuators = _actuators(scene) if isinstance(scene, Scene) else {}

    def driven(path: str) -> list[int]:
        edges = {str(edge.path): i for i, edge in enumerate(eq.reduced.edges)}
        # a universal joint is two joints, below its name
        found = [edges[name] for name in sorted(edges) if name == path or name.startswith(f"{path}.")]
        return [int(t.r_at[i]) + k for i in found for k in range(t.dim[i])]

    for name in names:
        if name in actuators:
            out.append(_control(eq, name, actuators[name], driven))
            continue
        places = driven(name)
        for k, place in enumerate(places):
            whole = name if len(places) == 1 else f"{name}.{k}"
            share = Share(supplied=False, place=place, ratio=1.0)
            out.append(ImageNumber(whole, "", place, float(eq.drive[place]), (share,)))
    return out


def _control(eq: ReducedEquations, name: str, of: Actuator, driven: Callable[[str], list[int]]) -> ImageNumber:
    """The control of an actuator, with its forces on joints, or on the length of its tendon."""
    shares: list[Share] = []
    if of.tendon is None:
        for joint, ratio in zip(of.joints, np.atleast_1d(of.ratio), strict=True):
            shares.append(Share(False, driven(str(component_path("joints", joint)))[0], ratio))
    else:
        net, ratio = eq.reduced.attaching.network, float(np.ravel(of.ratio)[0])
        for one in net.injections:
            if one.port == tension_port(of.tendon):
                rows = enumerate(one.row.tolist(), len(net.inputs))
                shares += [Share(True, place, ratio * row) for place, row in rows if row]
    limits = (-math.inf, math.inf) if of.limits is None else (of.limits[0], of.limits[1])
    return ImageNumber(name, "", 0, 0.0, tuple(shares), limits)


def _outputs(eq: ReducedEquations, values: Array) -> list[ImageNumber]:
    t, names = eq.reduced.tables, [""] * values.size

    def add_outputs(first: int, path: object, parts: Sequence[str]) -> None:
        names[first : first + len(parts)] = [f"{path}.{part}" for part in parts]

    def counted(name: str, size: int) -> list[str]:
        return [name if size == 1 else f"{name}.{k}" for k in range(size)]

    for i, edge in enumerate(eq.reduced.joints):
        path, size = edge.path or edge.state or edge.name, edge.pair.size
        turns = edge.pair.code in (codes.SO3, codes.SE3, codes.SO3xR3)  # rotations are no coordinates
        add_outputs(int(t.q_at[i]), path, POSE[:size] if turns else counted("coordinate", size))
        if i < eq.reduced.links:
            add_outputs(eq.reduced.coordinates + int(t.r_at[i]), path, counted("rate", edge.pair.dim))
    first = eq.reduced.coordinates + eq.n
    for i in range(eq.reduced.links):
        edge = eq.reduced.joints[i]  # which carries the link: a cross is no body
        add_outputs(first + 7 * i, eq.reduced.places[i].path or f"{edge.path or edge.name}.link", POSE)
    names[-1] = "energy"
    return [
        ImageNumber(name, "J" if name == "energy" else "m" if ".position." in name else "", k, float(values[k]))
        for k, name in enumerate(names)
    ]
