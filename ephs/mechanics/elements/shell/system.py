"""Shells as systems: nodes are bodies, and each element is a storage of the relative poses of its four nodes.

Free joints lead from the section at the element's first corner to those at the others. Their relative poses q_2, q_3,
q_4 are 1 at rest; the storage pe has the strain energy ½ Δᵀ K Δ of the logarithms of the four edges. All elements share
their pattern and their machine code. Everything else is a joint's.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ephs.mechanics.elements import components
from ephs.mechanics.elements.bodies import rigid_body
from ephs.mechanics.elements.joints import joint
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.elements.shell.stiffness import EDGES
from ephs.operad import Directory, Path, Pattern, Port, PortType, junction, quantity
from ephs.operad.collector import paused_collector
from ephs.semantics import library
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.logarithms import logarithm_form, logarithm_loss
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Storage, power_ports
from ephs.semantics.spaces import SE3, pair, translation
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import Condition, proved

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

RELATIVE = quantity.relative_pose("free")
ROUNDING = 24 * 24 * float(np.finfo(float).eps)
"""Of the eigenvalues of K, relative to the largest: it is a product, summed over 24 numbers twice."""
SPRING = "shell_spring"
"""Name of the storage of an element."""
OTHERS = (2, 3, 4)
"""Corners whose poses are relative to that of corner 1."""
Numbers: TypeAlias = tuple[float, ...]
_STORED = power_ports(**{f"q_{corner}": RELATIVE for corner in OTHERS})
_READ = tuple(Path.of(f"q_{corner}") for corner in OTHERS)
_DAMPED = Directory(
    {f"p_{corner}": PortType(quantity.joint_momentum("free"), True) for corner in OTHERS}
    | {"s": PortType(quantity.entropy, True)}
    | {f"q_{corner}": PortType(RELATIVE, False) for corner in OTHERS}
)
_BOX = {
    name: Path.of(name) for name in ("pe", "mf", "env", *(f"{x}{k}" for x in ("o1", "o", "hc", "pkc") for k in OTHERS))
}


def shell_spring(rest: Array, stiffness: Array) -> Storage:
    """Strain energy of an element; ports q_2, q_3, q_4 of the free pair: 1 where there is no stress.

    Parameters
    ----------
    rest
        (4, 6) logarithms of the edges without stress: rad, m.
    stiffness
        (24, 24) K: symmetric, non-negative.

    Raises
    ------
    StructureError
        An array of a wrong shape, a number that is not finite, or K is not symmetric and non-negative.
    """
    return _spring(*_numbers(*_checked(rest, stiffness)))


def _spring(rest: Numbers, stiffness: Numbers) -> Storage:
    form = logarithm_form(EDGES, (*rest, *stiffness), SPRING)
    return Storage(
        SPRING,
        _STORED,
        energy=form.energy,
        gradient=form.gradient,
        discrete_gradient=form.discrete_gradient,
        parameters=(("rest", rest), ("stiffness", stiffness)),
        kernel=form.kernel,
        proof=_elastic,
        trusted=True,
    )


def _elastic() -> tuple[Condition, ...]:
    return proved("poses are even, and log reads q and −q alike; dE = Σ Bᵀ K Δ", *STATEMENTS["storage"])


def shell_damper(rest: Array, stiffness: Array, damping: float) -> Irreversible:
    """Kelvin–Voigt damping μ = Bᵀ τ K B of the rates ḋ = B u of the edges; ports p_2, p_3, p_4, s, reads q_2, q_3, q_4.

    Parameters
    ----------
    rest, stiffness
        As of a `shell_spring`.
    damping
        τ in s.

    Raises
    ------
    StructureError
        As of a `shell_spring`, or the damping is negative.
    """
    _require_damping(damping)
    rest, k = _checked(rest, stiffness)
    return _damper(*_numbers(rest, k), damping, _row(damping * k))


def _damper(rest: Numbers, stiffness: Numbers, damping: float, resistance: Numbers) -> Irreversible:
    matrix, kernel = logarithm_loss(EDGES, (*rest, *resistance), "shell_damper")
    return Irreversible(
        "shell_damper",
        _DAMPED,
        matrix,
        _READ,
        (("rest", rest), ("stiffness", stiffness), ("damping", float(damping))),
        kernel,
        proof=_dissipative,
        trusted=True,
    )


def _dissipative() -> tuple[Condition, ...]:
    return structures.dissipation_proof(_DAMPED, None)


@cache
def shell_pattern(*, damped: bool = False, heat: bool = False) -> Pattern:
    """An element: for its corners k = 2, 3, 4 offsets o1k, ok, the relation hck and the coupling pkck; the energy pe.

    The ports p1 … p4 carry the momenta of its nodes.

    Parameters
    ----------
    damped
        It has the loss mf.
    heat
        The heat of the loss leaves through the port s, in place of the box env.
    """
    momentum, rate = quantity.body_momentum, quantity.joint_momentum("free")
    junctions = {f"p{corner}": junction(momentum, exposed=True) for corner in (1, *OTHERS)}
    boxes = {"pe": {f"q_{k}": f"q_{k}" for k in OTHERS}}
    for k in OTHERS:
        junctions |= {f"p_c{k}": junction(momentum), f"p_j{k}": junction(momentum)}
        junctions |= {f"q_{k}": junction(RELATIVE), f"p_r{k}": junction(rate)}
        boxes[f"o1{k}"] = {"p1": "p1", "p_j1": f"p_c{k}"}
        boxes[f"o{k}"] = {"p2": f"p{k}", "p_j2": f"p_j{k}"}
        boxes[f"hc{k}"] = {"p_j1": f"p_c{k}", "p_j2": f"p_j{k}", "p_r": f"p_r{k}", "q_r": f"~q_{k}"}
        boxes[f"pkc{k}"] = {"q_r": f"q_{k}", "p_r": f"p_r{k}"}
    if damped:
        junctions["s"] = junction(quantity.entropy, exposed=heat)
        boxes["mf"] = {f"p_{k}": f"p_r{k}" for k in OTHERS} | {"s": "s"} | {f"q_{k}": f"~q_{k}" for k in OTHERS}
        boxes |= {} if heat else {"env": {"s": "s"}}
    return Pattern(junctions=junctions, boxes=boxes)


def shell_element(
    sections: "ArrayLike",
    at_rest: "ArrayLike",
    rest: "ArrayLike",
    stiffness: "ArrayLike",
    damping: float = 0.0,
    *,
    heat: bool = False,
) -> System:
    """A shell element between four bodies, which are its nodes; its ports p1 … p4 carry their momenta.

    Parameters
    ----------
    sections
        (4, 7) poses of the sections at the corners in their nodes.
    at_rest
        (3, 7) poses of the sections at corners 2, 3, 4 relative to that at corner 1, without stress.
    rest
        (4, 6) logarithms of its edges without stress: rad, m.
    stiffness
        (24, 24) K of the energy ½ Δᵀ K Δ of their changes.
    damping
        Kelvin–Voigt time in s.
    heat
        The heat of damping leaves through a port s; else an environment inside takes it.

    Raises
    ------
    StructureError
        As of `shell_spring`, or the damping is negative.
    """
    _require_damping(damping)
    frames, between = np.asarray(sections, dtype=float), np.asarray(at_rest, dtype=float)
    pattern = shell_pattern(damped=damping != 0.0, heat=damping != 0.0 and heat)
    return System(pattern, _parts(frames, between, *_checked(rest, stiffness), damping, heat=heat))


def _parts(
    frames: Array, between: Array, rest: Array, stiffness: Array, damping: float, *, heat: bool
) -> Directory[System | Primitive]:
    """Fillings of the boxes of an element, of numbers that were checked."""
    free, numbers = pair("free"), _numbers(rest, stiffness)
    parts: dict[Path, System | Primitive] = {_BOX["pe"]: _spring(*numbers)}
    for k, place in zip(OTHERS, between, strict=True):
        parts[_BOX[f"o1{k}"]] = frame_change(SE3.compose(frames[0], place), "p_j1", "p1")
        parts[_BOX[f"o{k}"]] = frame_change(frames[k - 1], "p_j2", "p2")
        parts[_BOX[f"hc{k}"]], parts[_BOX[f"pkc{k}"]] = components.holonomic(free), components.pair_coupling(free)
    if damping != 0.0:
        parts[_BOX["mf"]] = _damper(*numbers, damping, _row(damping * stiffness))
        if not heat:
            parts[_BOX["env"]] = library.environment()
    return Directory.trusted(parts)


@paused_collector()
def shell_system(
    shell: Shell,
    *,
    gravity: "ArrayLike" = (0.0, 0.0, 0.0),
    damping: float = 0.0,
    held: Sequence[int] = (),
    carried: "Mapping[str, tuple[ArrayLike, Sequence[int]]] | None" = None,
    pinned: Sequence[int] = (),
    fixed: Sequence[int] = (),
    shared: Sequence[int] = (),
    heat: bool = False,
    spread: bool = False,
    start: "tuple[ArrayLike, ArrayLike] | None" = None,
) -> System:
    """A shell that moves: bodies ``node0`` … at its points, and elements ``element0`` … between them.

    Parameters
    ----------
    gravity
        (3,) acceleration in world axes, m/s².
    damping
        Kelvin–Voigt time in s; an environment in each element takes the heat.
    held
        Numbers of nodes that are welded to the ground.
    carried
        Nodes that are welded to other bodies: port of a body's momentum -> its pose (7,) in the world at the start, and
        their numbers.
    pinned
        Held or carried nodes that turn freely: a spherical joint ``pin0`` …, by their number, is in place of the weld.
    fixed
        Held or carried nodes that keep their mass: a fixed joint ``weld0`` …, by their number, is in place of the weld,
        which leaves it out.
    shared
        Numbers of nodes whose momenta are ports ``p0`` …, by their number: for what else acts on them.
    heat
        The heat of damping leaves through a port s.
    spread
        Inertia of nodes about the normal of `Shell.tensors`: for explicit methods, which may take longer steps.
    start
        (m, 7) poses in the world and (m, 6) twists of the nodes at the start; without stress and at rest where None.

    Raises
    ------
    StructureError
        The section has no mass, or a node is not one of the shell's.
    """
    count, inertia, bodies = len(shell.points), shell.inertia, dict(carried or {})
    tensors = shell.tensors(spread=spread)
    for key, nodes in (("held", held), ("shared", shared), *((port, nodes) for port, (_, nodes) in bodies.items())):
        if wrong := [node for node in nodes if not 0 <= node < count]:
            raise StructureError("parameter", "shell", key=key, found=wrong, expected=f"nodes of 0 … {count - 1}")
    if not shell.section.mass > 0.0:
        raise StructureError("parameter", "shell", key="section", found="no mass", expected="a density above 0")
    welded = {node: (port, np.asarray(pose, dtype=float)) for port, (pose, nodes) in bodies.items() for node in nodes}
    welded |= dict.fromkeys(held, ("p_ground", SE3.identity()))
    for key, nodes in (("pinned", pinned), ("fixed", fixed)):
        if wrong := [node for node in nodes if node not in welded]:
            raise StructureError("parameter", "shell", key=key, found=wrong, expected="held or carried nodes")
    given = (shell.poses, np.zeros((count, 6))) if start is None else start
    poses, twists = (np.asarray(each, dtype=float) for each in given)
    momentum, turning, weighing, outer = quantity.body_momentum, *map(frozenset, (pinned, fixed, shared))
    inner, own = (junction(momentum, exposed=exposed) for exposed in (False, True))
    on = [Path.of(f"p{i}") for i in range(count)]
    junctions = {path: own if i in outer else inner for i, path in enumerate(on)}
    junctions |= {Path.of(port): own for port in bodies}
    boxes: dict[Path, Mapping[Path, Port] | dict[str, str]] = {}
    parts: dict[Path, System | Primitive] = {}
    made: dict[bytes, System] = {}  # bodies, which nodes with one inertia share
    for i, pose in enumerate(poses):
        node = Path.of(f"node{i}")
        if i in welded and i not in turning and i not in weighing:
            port, at = welded[i]
            boxes[node] = {"body": port, "p": f"p{i}"}
            parts[node] = frame_change(SE3.compose(SE3.inverse(at), pose), "p", "body")
        else:
            boxes[node] = {"p": f"p{i}"}
            key = inertia[i, 3].tobytes() + tensors[i].tobytes()
            if key not in made:
                made[key] = rigid_body(float(inertia[i, 3]), tensors[i], gravity, strict=not spread)
            moving = np.concatenate([tensors[i] @ twists[i, :3], inertia[i, 3:] * twists[i, 3:]])
            parts[node] = made[key].with_initial({"pe.q": pose, "ke.p": moving})
        if i in turning:
            port, at = welded[i]
            pin = Path.of(f"pin{i}")
            boxes[pin] = {"p1": port, "p2": f"p{i}"}
            apart = SE3.compose(SE3.inverse(at), pose)
            parts[pin] = joint("spherical", translation(apart[4:])).with_initial({"pe.q_r": apart[:4]})
        elif i in weighing:
            port, at = welded[i]
            weld = Path.of(f"weld{i}")
            boxes[weld] = {"p1": port, "p2": f"p{i}"}
            parts[weld] = joint("fixed", SE3.compose(SE3.inverse(at), pose))
    if len(held):
        junctions[Path.of("p_ground")], ground = inner, Path.of("ground")
        boxes[ground], parts[ground] = {"p": "p_ground"}, components.ground()
    hot = Path.of("s")
    warm = {hot: Port(hot, True)} if heat and damping else {}
    junctions |= {hot: junction(quantity.entropy, exposed=True)} if warm else {}
    sections = np.concatenate([shell.axes, np.zeros((*shell.cells.shape, 3))], axis=2)
    at_rest = _from_first(shell)
    strained = None if np.array_equal(poses, shell.poses) else _strained(shell, at_rest, poses)
    _require_damping(damping)
    rest, stiffness = _checked(shell.rest, shell.matrix)
    pattern = shell_pattern(damped=damping != 0.0, heat=bool(warm))
    corners, at_node = tuple(Path.of(f"p{corner}") for corner in (1, *OTHERS)), [Port(path, True) for path in on]
    for e, nodes in enumerate(shell.cells.tolist()):
        box = Path.of(f"element{e}")
        boxes[box] = {corner: at_node[node] for corner, node in zip(corners, nodes, strict=True)} | warm
        filled = _parts(sections[e], at_rest[e], rest[e], stiffness[e], damping, heat=bool(warm))
        element = System(pattern, filled) if e == 0 else System.trusted(pattern, filled)  # all like the first
        states = {} if strained is None else {f"pe.q_{k}": strained[e, k - 2] for k in OTHERS}
        parts[box] = element.with_initial(states) if states else element
    return System.of(Pattern(junctions=junctions, boxes=boxes), parts)


def _from_first(shell: Shell) -> Array:
    """(n, 3, 7) poses of sections 2, 3, 4 of the elements at rest, relative to the first."""
    along = [[SE3.exp(log) for log in logs[:3]] for logs in shell.rest]
    # corner 2 by edge 12, corner 4 by edge 14, corner 3 by edges 14 and 43: see `EDGES`
    return np.array([[two, SE3.compose(four, three), four] for two, three, four in along])


def _strained(shell: Shell, at_rest: Array, poses: Array) -> Array:
    """(n, 3, 7) states of the elements' storages with their nodes at poses (m, 7)."""
    out = np.empty(at_rest.shape)
    for e, (places, nodes) in enumerate(zip(at_rest, shell.cells, strict=True)):
        turns = [np.concatenate([turn, np.zeros(3)]) for turn in shell.axes[e]]
        first, *others = (SE3.compose(poses[i], turn) for i, turn in zip(nodes, turns, strict=True))
        for k, (rest, frame) in enumerate(zip(places, others, strict=True)):
            now = SE3.compose(SE3.inverse(first), frame)
            out[e, k] = SE3.normalise(SE3.compose(SE3.inverse(rest), now))
    return out


def _checked(given: "ArrayLike", stiffness: "ArrayLike") -> tuple[Array, Array]:
    """Logarithms (…, 4, 6) and K (…, 24, 24) of one element, or of many."""
    rest, k = np.asarray(given, dtype=float), np.asarray(stiffness, dtype=float)
    for key, found, sound, expected in (
        ("rest", rest, rest.shape[-2:] == (4, 6) and bool(np.isfinite(rest).all()), "finite numbers (4, 6)"),
        ("stiffness", k, k.shape[-2:] == (24, 24) and bool(np.isfinite(k).all()), "finite numbers (24, 24)"),
        ("stiffness", k, k.ndim > 1 and bool(np.array_equal(k, k.swapaxes(-1, -2))), "a symmetric matrix"),
    ):
        if not sound:
            raise StructureError("parameter", "shell", key=key, found=f"shape {found.shape}", expected=expected)
    values = symmetric_eigenvalues(k)
    least, most = values[..., 0], values[..., -1]
    if (below := least < -ROUNDING * most).any():
        text = f"the eigenvalue {least[below].min():.3g}"
        raise StructureError("parameter", "shell", key="stiffness", found=text, expected="none below 0")
    return rest, k


def _require_damping(damping: float) -> None:
    if not 0.0 <= damping < np.inf:
        raise StructureError("parameter", "shell", key="damping", found=damping, expected="a number ≥ 0")


def _numbers(rest: Array, stiffness: Array) -> tuple[Numbers, Numbers]:
    """Logarithms and K of an element as documents have them; its parts share them."""
    return _row(rest), _row(stiffness)


def _row(values: Array) -> Numbers:
    return tuple(values.ravel().tolist())
