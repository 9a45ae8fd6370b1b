"""Merge rigidly joined bodies: one inertia, one potential, the second body's joints attached to the first.

With x = q₁⁻¹q₂ constant the twists are related by u₂ = Ad_{x⁻¹}u₁, so that 𝕀 = 𝕀₁ + Ad*_{x⁻¹}𝕀₂Ad_{x⁻¹}, p = p₁ +
Ad*_{x⁻¹}p₂, V(q) = V₁(q) + V₂(q x); gyroscopic forces keep their formula.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.elements import components
from ephs.mechanics.rewrite.frames import DraftBody, bodies, inertia_at, joint_at
from ephs.mechanics.rewrite.rewrite import Rule, RuleSite, State, StateMap, Strength, SystemDraft
from ephs.operad import Path, quantity
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.primitives import Irreversible, Point, Reversible, Storage, power_ports
from ephs.semantics.primitives.pullback import Map, pull_back
from ephs.semantics.spaces import SE3
from ephs.semantics.verdicts.verdict import Condition

NAME = "merge rigidly connected bodies"
REFERENCE = Reference()


@final
@dataclass(frozen=True, slots=True, eq=False)
class _BodyBoxes:
    """A body's boxes and its inertia (6, 6)."""

    body: DraftBody
    kinetic: Path
    gyroscopic: Path
    inertia: Array


def _parts(draft: SystemDraft, body: DraftBody | None) -> _BodyBoxes | None:
    """None where the junction is not that of a whole body."""
    if body is None:
        return None
    on = [box for box, _ in draft.on(body.momentum)]
    kinetic, inertia = draft.stored(body.momentum), inertia_at(draft, body.momentum)
    turning = next((box for box in on if draft.fillings[box].name == "lie_poisson"), None)
    if kinetic is None or inertia is None or turning is None:
        return None
    return _BodyBoxes(body, kinetic, turning, inertia)


def _places(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    return ((box,) for box, part in list(draft.fillings.items()) if part.name == "holonomic")


def _merge_site(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    (box,) = place
    joint = joint_at(draft, box)
    if joint is None or joint.pair.dim != 0:
        return None
    wires, found = draft.wires[box], bodies(draft)
    direct = [wires[p].junction for p in (Path.of("p_j1"), Path.of("p_j2")) if p in wires]
    reason = f"{box} joins {joint.ends[0] or 'the ground'} and {joint.ends[1] or 'the ground'} rigidly"
    first, second = (_parts(draft, found.get(end) if end is not None else None) for end in joint.ends)
    if first is None or second is None:
        refusal = "one of its ends is not a body with inertia and pose"
        return RuleSite(NAME, box, Strength.TRAJECTORIES, reason, refusal, lambda _draft: StateMap())
    x = SE3.compose(joint.offsets[0], SE3.inverse(joint.offsets[1]))
    if direct != list(joint.ends):
        return RuleSite(NAME, box, Strength.TRAJECTORIES, reason, "its offsets come first", lambda _draft: StateMap())
    if second.body.momentum < first.body.momentum:  # the first name is kept
        first, second, x = second, first, SE3.inverse(x)
    merge = _Merge(box, first, second, SE3.normalise(x), joint.relative)
    return RuleSite(NAME, box, Strength.TRAJECTORIES, reason, merge.refusal(draft), merge.make)


@final
class _Merge:
    """The second body becomes part of the first one."""

    def __init__(self, box: Path, first: _BodyBoxes, second: _BodyBoxes, x: Array, relative: Path) -> None:
        self.box, self.first, self.second, self.x, self.relative = box, first, second, x, relative
        self.carried = SE3.adjoint(SE3.inverse(x))
        self.inertia = first.inertia + self.carried.T @ second.inertia @ self.carried

    def _own(self, draft: SystemDraft) -> list[Path]:
        """The boxes of the joint."""
        wires = draft.wires[self.box]
        inner = [wires[Path.of(port)].junction for port in ("p_r", "q_r")]
        return list(dict.fromkeys(box for junction in inner for box, _ in draft.on(junction)))

    def refusal(self, draft: SystemDraft) -> str:
        """Why not, in words."""
        gone = self.second.body
        if draft.junctions[gone.momentum].exposed:
            return f"{gone.momentum} is an outer port"
        for body in (self.first.body, gone):
            if draft.junctions[body.pose].exposed or draft.reading(body.pose):
                return f"the pose {body.pose} is read"
            if len(draft.on(body.pose)) != 2:
                return f"other parts than a potential act on the pose {body.pose}"
        if readers := [b for b, _ in draft.reading(gone.momentum) if b != self.second.gyroscopic]:
            return f"{readers[0]} reads the momentum {gone.momentum}"
        if others := [b for b in self._own(draft) if isinstance(draft.fillings[b], Irreversible)]:
            return f"{others[0]} comes first"
        return ""

    def make(self, draft: SystemDraft) -> StateMap:
        """Apply the merge."""
        first, second = self.first, self.second
        own = self._own(draft)
        pe1, pe2 = draft.fillings[first.body.potential], draft.fillings[second.body.potential]
        assert isinstance(pe1, Storage)
        assert isinstance(pe2, Storage)
        inner = [draft.wires[self.box][Path.of(port)].junction for port in ("p_r", "q_r")]
        lost = [second.body.coupling, second.body.potential, second.kinetic, second.gyroscopic]
        draft.remove(dict.fromkeys([*own, *lost]))
        draft.remove([], [*inner, second.body.pose])
        kind, target = draft.kind(first.body.momentum), first.body.momentum
        moved: dict[Path, list[Path]] = {}
        for box, port in draft.on(second.body.momentum):
            moved.setdefault(box, []).append(port)
        for box, ports in moved.items():
            process = draft.fillings[box]
            assert isinstance(process, (Reversible, Irreversible))
            draft.replace(
                box,
                pull_back(process, dict.fromkeys(ports, Map(self.carried, kind))),
                dict.fromkeys(ports, target),
            )
        draft.remove([], [second.body.momentum])
        inverse = np.linalg.inv(self.inertia)
        entries = (("inertia", tuple(self.inertia.ravel().tolist())),)
        ports = power_ports(p=quantity.body_momentum)
        draft.replace(first.kinetic, structures.quadratic("kinetic", ports, 0.5 * (inverse + inverse.T), entries), {})
        draft.replace(first.body.potential, self._potential(pe1, pe2), {})
        return StateMap(self._forward, self._back)

    def _potential(self, one: Storage, two: Storage) -> Storage:
        """V₁(q) + V₂(q x); as (q⁰exp v) x = (q⁰x) exp(Ad_{x⁻¹}v), discrete gradients add up as well."""
        if all(pe.kernel is not None and pe.kernel.name == "no_effort" for pe in (one, two)):
            return components.no_potential(quantity.pose, "q")
        q, x, carried = Path.of("q"), self.x, self.carried

        def there(point: Point) -> Point:
            return {q: SE3.compose(point[q], x)}

        def discrete(point: Point, v: Array) -> Array:
            # efforts at poses are derivatives of the energy, independent of the reference
            near = one.discrete_effort(point, v, REFERENCE)
            return near + carried.T @ two.discrete_effort(there(point), carried @ v, REFERENCE)

        return Storage(
            "potential",
            power_ports(q=quantity.pose),
            energy=lambda point: float(one.energy(point)) + float(two.energy(there(point))),
            gradient=lambda point: one.energy_gradient(point) + carried.T @ two.energy_gradient(there(point)),
            discrete_gradient=discrete,
            parameters=(("first", one.parameters), ("second", two.parameters), ("x", tuple(x.tolist()))),
            proof=lambda: tuple(
                Condition(a.statement, a.proved and b.proved, ("both", a.how, b.how))
                for a, b in zip(one.verdict.conditions, two.verdict.conditions, strict=True)
            ),
            trusted=True,
        )

    def _forward(self, state: State) -> dict[Path, Array]:
        one, two = self.first.kinetic / "p", self.second.kinetic / "p"
        gone = {two, self.second.body.state, self.relative}
        out = {path: value for path, value in state.items() if path not in gone}
        return {**out, one: state[one] + self.carried.T @ state[two]}

    def _back(self, state: State, start: State) -> dict[Path, Array]:
        one, two = self.first.kinetic / "p", self.second.kinetic / "p"
        u = np.linalg.solve(self.inertia, state[one])
        pose = SE3.normalise(SE3.compose(state[self.first.body.state], self.x))
        at = self.second.body.state
        sign = 1.0 if float(pose[:4] @ start[at][:4]) >= 0.0 else -1.0
        return {
            **state,
            one: self.first.inertia @ u,
            two: self.second.inertia @ (self.carried @ u),
            at: np.concatenate([sign * pose[:4], pose[4:]]),
            self.relative: start[self.relative],
        }


WHY = "rigidly connected bodies move as one: the twist of the second is that of the first, in its own frame"
MERGE = Rule(NAME, Strength.TRAJECTORIES, WHY, _places, _merge_site)
"""Fixed joints between bodies: their wrenches are lost, all else stays."""
