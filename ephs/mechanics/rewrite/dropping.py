"""Drop components without effect: zero friction, unread poses, joints without constraints, zero gyroscopic forces.

Each rule checks its condition on the structures as they are, and refuses in words where it does not hold.
"""

from collections.abc import Callable, Iterator

import numpy as np

from ephs.mechanics.rewrite.frames import DraftJoint, anchor, bodies, inertia_at, joint_at, joints, reach
from ephs.mechanics.rewrite.merging import MERGE
from ephs.mechanics.rewrite.rewrite import Rule, RuleSite, State, StateMap, Strength, SystemDraft
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import CONSTRAINT, rank_of

ROUNDING = 1e-12
FIRST = "comes first"
SAMPLES = 6


def _free_of_energy(part: Primitive | None) -> bool:
    """Whether a storage's energy is constant: the effort of its kernel is zero."""
    return (
        isinstance(part, Storage)
        and not part.environment
        and part.kernel is not None
        and part.kernel.name == "no_effort"
    )


# ---- friction ---------------------------------------------------------------------------------------------------


def _frictions(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    return ((box,) for box, part in list(draft.fillings.items()) if isinstance(part, Irreversible))


def _resists(part: Irreversible) -> bool:
    """Whether it may be dropped: only a numerical resistance is known to be zero."""
    kernel = part.kernel
    if kernel is None:
        return True
    if kernel.name != "dissipation" or part.reads:
        return True
    efforts = np.ones(part.bundle.size)
    return bool(np.any(part.matrix({}, efforts, Reference())[:, :-1]))


def _friction(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    (box,) = place
    part = draft.fillings.get(box)
    if not isinstance(part, Irreversible):
        return None
    heat = [draft.wires[box][p].junction for p, _, q in part.bundle.items() if q.kind == "entropy"]
    alone = [
        j for j in heat if {b for b, _ in draft.on(j)} == {box, draft.stored(j)} and not draft.junctions[j].exposed
    ]
    sinks = [b for j in alone if (b := draft.stored(j)) is not None and draft.fillings[b].kind == "environment"]
    refusal = "it may dissipate: its resistance is not zero" if _resists(part) else ""
    read = [j for j in alone if draft.stored(j) in sinks and draft.reading(j)]
    if not refusal and read:
        refusal = f"the state at {read[0]} is read"
    at = [where.junction for where in draft.wires[box].values()]
    lonely = [j for j in at if {b for b, _ in draft.on(j)} == {box} and draft.junctions[j].exposed]
    if not refusal and lonely:
        refusal = f"nothing else is connected to the outer port {lonely[0]}"

    def make(draft: SystemDraft) -> StateMap:
        touched = [where.junction for where in draft.wires[box].values()]
        lost = {sink / port for sink in sinks for port in _storage(draft, sink).bundle.ports}
        draft.remove([box, *sinks])
        draft.remove([], [j for j in dict.fromkeys(touched) if not draft.on(j) and not draft.reading(j)])
        return _without(lost, lambda _state, start: {path: start[path] for path in lost})

    reason = f"{box} resists nothing" + (f", and no heat reaches {sinks[0]}" if sinks else "")
    return RuleSite("remove friction of zero resistance", box, Strength.RELATION, reason, refusal, make)


def _storage(draft: SystemDraft, box: Path) -> Storage:
    part = draft.fillings[box]
    assert isinstance(part, Storage)
    return part


def _without(lost: set[Path], rebuilt: Callable[[State, State], dict[Path, Array]]) -> StateMap:
    """States that are dropped and reconstructed."""

    def forward(state: State) -> dict[Path, Array]:
        return {path: value for path, value in state.items() if path not in lost}

    def back(state: State, start: State) -> dict[Path, Array]:
        return {**state, **rebuilt(state, start)}

    return StateMap(forward, back)


# ---- poses --------------------------------------------------------------------------------------------------------


def _potentials(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    return ((box,) for box, part in list(draft.fillings.items()) if isinstance(part, Storage) and _is_pose(part))


def _is_pose(part: Storage) -> bool:
    return [q.kind for _, _, q in part.bundle.items()] == ["pose"]


def _pose(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    (box,) = place
    found = bodies(draft)
    body = next((b for b in found.values() if b.potential == box), None)
    if body is None:
        return None
    refusal, way = "", None
    if not _free_of_energy(draft.fillings[box]):
        refusal = "its potential changes with the pose"
    elif draft.junctions[body.pose].exposed:
        refusal = f"the pose {body.pose} is an outer port"
    elif readers := draft.reading(body.pose):
        refusal = f"{readers[0][0]} reads the pose"
    elif others := [b for b, _ in draft.on(body.pose) if b not in (box, body.coupling)]:
        refusal = f"{others[0]} acts on the pose"
    elif {b for b, _ in draft.on(body.momentum)} == {body.coupling} and draft.junctions[body.momentum].exposed:
        refusal = f"nothing else is connected to the outer port {body.momentum}"
    elif waiting := [at for at in _joints_of(draft, body.momentum) if _goes(draft, at)]:
        refusal = f"{waiting[0]} {FIRST}"  # it stores the pose too, or is reconstructed from it
    else:
        # of bodies without connection to the ground the first keeps its pose, in any order of the others
        way = reach(draft, body.momentum, {None, *(j for j in found if j < body.momentum)})
        if way is None:
            refusal = "no joint ties the body to a frame whose pose is kept: it could not be computed from the others"
    known = {None: None} | {j: b.state for j, b in found.items()}

    def make(draft: SystemDraft) -> StateMap:
        draft.remove([box, body.coupling], [body.pose])
        if not draft.on(body.momentum) and not draft.junctions[body.momentum].exposed:
            draft.remove([], [body.momentum])

        def rebuilt(state: State, start: State) -> dict[Path, Array]:
            assert way is not None
            source = known[anchor(way)]
            pose = SE3.identity() if source is None else state[source]
            for joint, forward in way:
                pose = joint.across(pose, state, forward=forward)
            sign = 1.0 if float(pose[:4] @ start[body.state][:4]) >= 0.0 else -1.0
            return {body.state: np.concatenate([sign * pose[:4], pose[4:]])}

        return _without({body.state}, rebuilt)

    path = "" if way is None else f", and it follows from {' and '.join(str(joint.box) for joint, _ in way)}"
    reason = f"no other part depends on the pose of {body.momentum}{path}"
    return RuleSite("remove an unused pose", box, Strength.RELATION, reason, refusal, make)


def _joints_of(draft: SystemDraft, momentum: Path) -> list[Path]:
    """The joints of a body."""
    return [joint.box for joint in joints(draft) if momentum in joint.ends]


def _goes(draft: SystemDraft, box: Path) -> bool:
    """Whether a joint is free or rigid, now or after another rewrite."""
    site = _joint(draft, (box,))
    return _merges(draft, box) or (site is not None and (not site.refusal or site.refusal.endswith("first")))


def _merges(draft: SystemDraft, box: Path) -> bool:
    site = MERGE.at(draft, (box,))
    return site is not None and (not site.refusal or site.refusal.endswith("first"))


# ---- joints that hold nothing ---------------------------------------------------------------------------------------


def _relations(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    return ((box,) for box, part in list(draft.fillings.items()) if part.name == "holonomic")


def _joint(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    (box,) = place
    joint = joint_at(draft, box)
    if joint is None or joint.pair.dim != 6:
        return None
    ports = draft.wires[box]
    rate, relative = ports[Path.of("p_r")].junction, ports[Path.of("q_r")].junction
    energy = draft.stored(relative)
    found = bodies(draft)
    couplings = [b for b, _ in draft.on(relative) if b != energy]
    refusal = ""
    if not _free_of_energy(draft.fillings.get(energy) if energy is not None else None):
        refusal = "its spring pulls"
    elif others := [b for b, _ in draft.on(rate) if b != box and b not in couplings]:
        idle = [not _resists(p) for b in others if isinstance(p := draft.fillings[b], Irreversible)]
        refusal = f"{others[0]} {FIRST}" if len(idle) == len(others) and all(idle) else f"{others[0]} acts on its rate"
    elif draft.junctions[rate].exposed or draft.junctions[relative].exposed:
        refusal = "it is driven from outside"
    elif others := [b for b, _ in draft.reading(relative) if b != box]:
        refusal = f"{others[0]} reads its relative pose"
    elif lost := [end for end in joint.ends if end is not None and end not in found]:
        refusal = f"the pose of {lost[0]} is not kept, so the relative pose could not be computed from it"
    ends = [None if end is None else found[end].state for end in joint.ends if end is None or end in found]

    def make(draft: SystemDraft) -> StateMap:
        touched = [where.junction for where in draft.wires[box].values()]
        draft.remove([box, *couplings, *([energy] if energy is not None else [])])
        draft.remove([], [j for j in dict.fromkeys([*touched, relative]) if _empty(draft, j)])

        def rebuilt(state: State, start: State) -> dict[Path, Array]:
            one, two = (SE3.identity() if path is None else state[path] for path in ends)
            first, second = SE3.compose(one, joint.offsets[0]), SE3.compose(two, joint.offsets[1])
            pose = SE3.normalise(SE3.compose(SE3.inverse(first), second))
            sign = 1.0 if float(pose[:4] @ start[joint.relative][:4]) >= 0.0 else -1.0
            return {joint.relative: np.concatenate([sign * pose[:4], pose[4:]])}

        return _without({joint.relative}, rebuilt)

    reason = f"{box} has six degrees of freedom, without constraint, spring and friction"
    return RuleSite("remove a joint without effect", box, Strength.RELATION, reason, refusal, make)


def _empty(draft: SystemDraft, junction: Path) -> bool:
    return not draft.on(junction) and not draft.reading(junction) and not draft.junctions[junction].exposed


# ---- gyroscopic forces ------------------------------------------------------------------------------------------


def _gyroscopes(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    return ((box,) for box, part in list(draft.fillings.items()) if part.name == "lie_poisson")


def _gyroscopic(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    (box,) = place
    part = draft.fillings.get(box)
    if not isinstance(part, Reversible) or part.kernel is None or part.name != "lie_poisson":
        return None
    momentum = next(iter(draft.wires[box].values())).junction
    inertia = inertia_at(draft, momentum)
    moves, refusal, reason = np.eye(6), "", ""
    if draft.junctions[momentum].exposed:
        refusal = "a wrench from outside may turn it"
    elif inertia is None:
        refusal = "nothing stores its momentum"
    elif waiting := [at for at in _joints_of(draft, momentum) if _merges(draft, at)]:
        refusal = f"{waiting[0]} {FIRST}"
    else:
        if part.kernel.name == "lie_poisson":
            moves = _moves(draft, momentum)
        vanish = _vanish(part, inertia, moves)
        turning, sliding = (np.abs(rows).max(initial=0.0) > ROUNDING for rows in (moves[:3], moves[3:]))
        if vanish and not turning:
            reason = f"{momentum} never turns"
        elif vanish and not sliding:
            reason = f"{momentum} turns about a principal axis through its centre of mass"
        elif vanish:
            reason = f"the inertia of {momentum} is the same about all axes, and its velocity is taken in world axes"
        else:
            refusal = "it turns not only about a principal axis through its centre of mass"
            if np.ptp(np.diag(inertia)[:3]) < ROUNDING * inertia[0, 0] and sliding:
                refusal += ": with an inertia that is the same about all axes the transport term p_υ × ω remains"
            elif moves.shape[1] <= 3:
                refusal += ": in planar motion, too, the transport term p_υ × ω remains"

    def make(draft: SystemDraft) -> StateMap:
        draft.remove([box])
        return StateMap()

    return RuleSite("remove vanishing gyroscopic forces", box, Strength.RELATION, reason, refusal, make)


def _vanish(part: Reversible, inertia: Array, moves: Array) -> bool:
    """Whether the forces are zero at every twist in the span of the columns: a quadratic form, by its polarisation."""
    port = next(iter(part.bundle.ports))

    def force(one: Array, other: Array) -> Array:
        return part.structure({port: inertia @ one})[0] @ other

    size = float(np.abs(inertia).max()) * max(1.0, float(np.abs(moves).max(initial=0.0))) ** 2
    pairs = [(a, b) for i, a in enumerate(moves.T) for b in moves.T[i:]]
    return all(float(np.abs(force(a, b) + force(b, a)).max()) <= ROUNDING * size for a, b in pairs)


def _moves(draft: SystemDraft, momentum: Path) -> Array:
    """(6, k), orthonormal: a space of all possible twists of the body, by the joints from the ground to it.

    The joints' coordinates are drawn, so that no special configuration is taken for all.
    """
    way = reach(draft, momentum, {None})
    if way is None:
        return np.eye(6)
    rng, columns = np.random.default_rng(7), list[Array]()
    for _ in range(SAMPLES):
        span = np.zeros((6, 0))
        for joint, forward in way:
            span = _carried(joint, forward, span, rng)
        columns.append(span)
    u, sizes, _ = svd(np.hstack(columns))
    return u[:, : rank_of(sizes, CONSTRAINT)] if sizes.size and sizes[0] > 0.0 else np.zeros((6, 0))


def _carried(joint: DraftJoint, forward: bool, span: Array, rng: np.random.Generator) -> Array:
    """Twists of the next body from those of the last one and the joint's own, at a random element."""
    pose = joint.pair.include(joint.pair.manifold.random(rng))
    near, far = joint.offsets if forward else joint.offsets[::-1]
    step = pose if forward else SE3.inverse(pose)
    frame = SE3.adjoint(SE3.inverse(SE3.compose(near, step)))
    # B is in the axes of C2, which is near by where the joint is passed backwards
    own = joint.pair.basis if forward else SE3.adjoint(pose) @ joint.pair.basis
    return SE3.adjoint(far) @ np.hstack([frame @ span, own])


WHY_FRICTION = "zero resistance gives no force and no heat, and the store of that heat takes up no other heat"
WHY_POSE = "no potential depends on these poses and no part reads them: they follow from the joints"
WHY_JOINT = (
    "six degrees of freedom without spring, friction and drive have no effect: coordinates follow from the bodies"
)
WHY_GYROSCOPIC = "ad*_u p vanishes for every twist that the joints allow the body"

DROP_FRICTION = Rule("remove friction of zero resistance", Strength.RELATION, WHY_FRICTION, _frictions, _friction)
"""A friction with μ ≡ 0, and the environment of its heat."""
DROP_POSE = Rule("remove an unused pose", Strength.RELATION, WHY_POSE, _potentials, _pose)
"""A body's pe, pkc and q if V is constant and the pose can be reconstructed."""
DROP_JOINT = Rule("remove a joint without effect", Strength.RELATION, WHY_JOINT, _relations, _joint)
"""Joints of six degrees of freedom without potential and friction."""
DROP_GYROSCOPIC = Rule(
    "remove vanishing gyroscopic forces", Strength.RELATION, WHY_GYROSCOPIC, _gyroscopes, _gyroscopic
)
"""lp where ad*_{dE(p)}(p) = 0 for all reachable p; an isotropic inertia or a plane motion is not enough in SE(3)."""
