"""Contacts between two surfaces."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from itertools import combinations, product
from typing import TYPE_CHECKING, Any, Self, final

import numpy as np

from ephs.mechanics.elements.contact import contact
from ephs.mechanics.scene.balls import ContactPoint, node_points, too_narrow
from ephs.mechanics.scene.custom import key
from ephs.mechanics.scene.element import ENVIRONMENT
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.polytope import MOST_FACES, faces_and_edges
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import Pair
from ephs.mechanics.scene.site import SceneLevel, Site, form_of, shells_of, surfaces_of
from ephs.mechanics.scene.surfaces import SOFT, ContactLaw, Surface, TouchingElement
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.mechanics.shapes.pairs import PAIRS, touches
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.systems.kept import once

if TYPE_CHECKING:
    from ephs.mechanics.scene.model import Scene

Points = tuple[ContactPoint, ...]
"""The points at which a contact's surfaces can touch."""
DEEP = 1e-2
"""Least reported overlap at the start, as a fraction of the mechanism's length."""
OVERLAP = 1e-9
"""Likewise for hard surfaces, for which it is refused."""


@final
class Contact(TouchingElement, section="contacts", said="pairs of surfaces that can touch"):
    """A contact between two surfaces; a resolved one has all numbers of its law."""

    surfaces: Pair = key("names of two surfaces; the other keys of this table replace theirs", names="surface")

    @rule(
        "surfaces", placed=True, found="{found}", expected="surfaces of two different bodies",
        advice="name surfaces of two bodies, or of a body and the ground",
    )  # fmt: skip
    def between(self, site: Site) -> Told:
        """Whether its surfaces are those of two bodies."""
        one, other = self._bodies(site)
        if self.surfaces[0] == self.surfaces[1]:
            return {"found": f'"{self.surfaces[0]}" twice'}
        return one != other or {"found": f'two surfaces of "{one}"'}

    @rule(
        "surfaces", placed=True, found='surfaces of "{one}" and "{other}", which fixed joints connect',
        expected="surfaces that can move relative to each other", advice="remove this contact",
    )  # fmt: skip
    def movable(self, site: Site) -> Told:
        """Whether joints let its bodies move."""
        (one, other), sets = self._bodies(site), _rigid(site.scene)
        return sets.leader(one) != sets.leader(other) or {"one": one, "other": other}

    @rule(
        "surfaces", placed=True, found="the surfaces of contacts.{first}",
        expected="a pair of surfaces without another contact", advice="remove one of the two contacts",
    )  # fmt: skip
    def first(self, site: Site) -> Told:
        """Whether it is the first of this pair."""
        pair = frozenset(self.surfaces)
        first = next((each.name for each in site.scene.contacts.values() if frozenset(each.surfaces) == pair), None)
        return first in (None, self.name) or {"first": first}

    @rule(
        "surfaces", placed=True, found="{found}", expected="{expected}",
        advice="refine the shell, enlarge the balls at its nodes, or list the contacts in [contacts]",
    )  # fmt: skip
    def fine(self, site: Site) -> Told:
        """Whether nothing comes through between the nodes of a shell: a plane does not, nor what is wide enough."""
        pair = self._pair(site)
        sheets = [shells_of(site.scene).get(each.body) for each in pair]
        if all(sheets):
            return {"found": "surfaces of two shells", "expected": "a surface of a body, or of the ground, at one end"}
        for sheet, own, other in ((sheets[0], *pair), (sheets[1], *pair[::-1])):
            if sheet is not None and not isinstance(told := too_narrow(sheet, own, other), bool):
                found = f"a {other.kind} of half width {told['width']:.4g} m"
                return {"found": found, "expected": f"one of {told['least']:.4g} m, or a plane, for the shell's nodes"}
            if sheet is not None and not any(node_points(site.scene, sheet, own, other)):
                return {"found": f'nodes that are all joined to "{other.body}"', "expected": "nodes that move"}
        return True

    @rule(
        "surfaces", at="", placed=True, found="a {one} and a {other}", expected="one plane at most",
        advice="list the pairs in contacts, or use other shapes",
    )  # fmt: skip
    def known(self, site: Site) -> Told:
        """Whether its shapes can meet."""
        one, other = (each.kind for each in self._pair(site))
        return (one, other) in PAIRS or (other, one) in PAIRS or {"one": one, "other": other}

    @rule(
        "surfaces", at="", placed=True, found="{found}", expected="one exponent",
        advice="give both surfaces the same exponent, or one to the contact",
    )  # fmt: skip
    def alike(self, site: Site) -> Told:
        """Whether an elastic contact has one exponent."""
        found = sorted(set(self._given(site, "exponent")))
        return self._is_hard(site) or len(found) < 2 or {"found": " and ".join(f"{n:g}" for n in found)}

    @rule(
        "surfaces", at="", placed=True, found="two surfaces without stiffness",
        expected="a stiffness of a surface or of the contact, or a restitution of both surfaces or the contact",
        advice="add one of these keys",
    )  # fmt: skip
    def firm(self, site: Site) -> bool:
        """Whether it is hard, or has a stiffness."""
        return self._is_hard(site) or bool(self._given(site, "stiffness"))

    def settled(self, site: Site) -> Self:
        """Itself with its values, else stiffness of both surfaces in series, the smaller friction, the larger of other
        numbers of elastic contacts, the lesser of hard ones."""
        given = {name: self._given(site, name) for name in ContactLaw.model_fields}
        friction = min(given["friction"], default=0.0)
        law: ConstitutiveLaw | Impact
        if self._is_hard(site):
            law = Impact(min(given["restitution"]), friction, min(given["tangential"], default=None))
        else:
            soft, n = given["stiffness"], next(iter(given["exponent"]), 1.0)
            stiffness = sum(k ** (-1.0 / n) for k in soft) ** -n if len(soft) > 1 else soft[0]
            more = {name: max(given[name]) for name in SOFT[2:] if given[name]}
            law = ConstitutiveLaw(float(stiffness), n, friction=friction, **more)
        rods = dict(site.scene.all_beams())
        sinks = [rods[path].heat for name in self.surfaces if (path := name.rpartition(".")[0]) in rods]
        heat = next((node for node in (*given["heat"], *sinks) if node is not None), ENVIRONMENT)
        return self.changed(**(dict.fromkeys(given) | asdict(law) | {"heat": heat}))

    def _pair(self, site: Site) -> list[Surface]:
        return [surfaces_of(site.scene)[name] for name in self.surfaces]

    def _bodies(self, site: Site) -> list[str]:
        return [each.body for each in self._pair(site)]

    def _given(self, site: Site, name: str) -> list[Any]:
        """Its own value at a key of its law, else those of both surfaces."""
        values = [[getattr(each, name) for each in level] for level in ([self], self._pair(site))]
        own, both = ([value for value in level if value is not None] for level in values)
        return own or both

    def _is_hard(self, site: Site) -> bool:
        """Whether it has restitution, or else a surface of it where none has stiffness."""
        said: list[TouchingElement] = [self]
        if self.restitution is None and self.stiffness is None:
            said = [*self._pair(site)]
        return all(each.stiffness is None for each in said) and any(each.restitution is not None for each in said)

    @property
    def law(self) -> ConstitutiveLaw | Impact:
        """Law of an elastic contact, or of a hard one, where it is resolved."""
        if self.stiffness is None:
            return Impact(self.restitution or 0.0, self.friction or 0.0, self.tangential)
        return ConstitutiveLaw(friction=self.friction or 0.0, **{name: getattr(self, name) for name in SOFT})

    @classmethod
    def _upgraded(cls, table: Mapping[str, Any]) -> dict[str, Any]:
        given = dict(table)
        return given | given.pop("law", {})

    def build(self, site: Site) -> None:
        points = contact_points(site.scene, self)
        warm = site.heated(self.heat or ENVIRONMENT)
        own = dict.fromkeys(body for point in points for body in point.bodies)
        port = {body: f"p{i}" for i, body in enumerate(own, 1)}
        touches = [(*point.frames, point.gap) for point in points]
        ends, shares = [(port[one], port[two]) for one, two in (x.bodies for x in points)], [x.share for x in points]
        made = contact(touches, self.law, heat=bool(warm), ends=ends, shares=shares)
        site.add(made, {port[body]: site.momentum(body) for body in own} | warm, initial=self._start)

    def _start(self, site: Site) -> Mapping[str, Array]:
        starts = once(site.scene, "poses at contacts", lambda: _relative_poses(site))
        return {f"point{i}.pe.q_r": pose for i, pose in enumerate(starts[tuple(self.surfaces)])}

    def __str__(self) -> str:
        return " – ".join(self.surfaces)


def _relative_poses(site: Site) -> dict[tuple[str, ...], Array]:
    """(points, 7) at the start, poses of the second frames of points in the first ones, by the surfaces of contacts.

    Those of all contacts are made at once, in about the time of those of one.
    """
    every = _every_point(site.scene)
    points = [point for some in every.values() for point in some]
    poses = {body: site.pose(body) for body in {body for point in points for body in point.bodies}}

    def placed(k: int) -> Array:
        bodies, frames = [poses[point.bodies[k]] for point in points], [point.frames[k] for point in points]
        return SE3.compose(*(np.array(each).reshape(-1, 7).T for each in (bodies, frames)))

    relative = SE3.normalise(SE3.compose(SE3.inverse(placed(0)), placed(1))).T
    ends = np.cumsum([len(some) for some in every.values()])
    return dict(zip(every, np.split(relative, ends), strict=False))


def contact_points(scene: "Scene", of: Contact) -> Points:
    """Points of a contact, as seen from a scene."""
    return _every_point(scene)[tuple(of.surfaces)]


def _every_point(scene: "Scene") -> dict[tuple[str, ...], Points]:
    """Points of all contacts of a scene, by their surfaces; made once and kept with it."""
    scene = form_of(scene)

    def made() -> dict[tuple[str, ...], Points]:
        surfaces = surfaces_of(scene)
        out: dict[tuple[str, ...], Points] = {}
        for _, each in scene.all_contacts():
            out[tuple(each.surfaces)] = _points(scene, *(surfaces[name] for name in each.surfaces))
        return out

    return once(scene, "contact points", made)


def _points(scene: "Scene", one: Surface, other: Surface) -> Points:
    for own, far in ((one, other), (other, one)):
        if (sheet := shells_of(scene).get(own.body)) is not None:
            return tuple(node_points(scene, sheet, own, far))
    points, swapped = touches(one.shape, one.frame, other.shape, other.frame)
    bodies = (other.body, one.body) if swapped else (one.body, other.body)
    return tuple(ContactPoint(bodies, (first, second), gap) for first, second, gap in points)


def _rigid(scene: "Scene") -> DisjointSets[str]:
    """Bodies, and the ground, in sets that fixed joints connect."""

    def made() -> DisjointSets[str]:
        sets = DisjointSets[str]()
        for _, joint in scene.all_joints():
            if joint.kind == "fixed":
                sets.join(joint.body1, joint.body2)
        return sets

    return once(scene, "rigid", made)


def meeting(scene: "Scene") -> Iterator[Contact]:
    """Contacts of surfaces on different bodies without a common joint but a free one, which fixed joints do not
    connect, and not of the same group or part; of a beam's pieces those further apart along it than half a circle of
    its radius: nearer ones cannot touch."""
    surfaces, rigid = surfaces_of(scene), _rigid(scene)
    for beam in scene.beams.values():
        pieces = [surfaces[node] for node in beam.nodes if node in surfaces]
        sizes = np.array([piece.shape["capsule"] for piece in pieces]).reshape(-1, 2)
        upto = np.append(0.0, np.cumsum(sizes[:, 1]))
        for i, j in combinations(range(len(pieces)), 2):
            if upto[j] - upto[i + 1] > np.pi * sizes[i, 0]:
                yield _contact(pieces[i], pieces[j])
    joined = {frozenset((j.body1, j.body2)) for _, j in scene.all_joints() if j.kind != "free"}
    joined |= {frozenset((name, end)) for name, sheet in scene.all_shells() for end in sheet.named("side")}
    level = [[each] for each in scene.surfaces.values()]
    level += [[each for name, each in surfaces.items() if name.startswith(f"{part}.")] for part in scene.parts]
    groups = {name: each.group for name, each in scene.surfaces.items() if each.group is not None}
    for some, others in combinations(level, 2):
        for one, other in product(some, others):
            apart = rigid.leader(one.body) != rigid.leader(other.body)
            apart = apart and frozenset((one.body, other.body)) not in joined
            if apart and (one.name not in groups or groups[one.name] != groups.get(other.name)):
                yield _contact(one, other)


def _contact(one: Surface, other: Surface) -> Contact:
    return Contact(surfaces=[one.name, other.name]).called(f"{one.name}_{other.name}".replace(".", "_"))


def overlaps(scene: "Scene", length: float, faults: list[Fault]) -> list[Fault]:
    """Contacts of a level whose surfaces overlap at the start by more than a part of a length in m, or of a shell's
    size; hard ones, and those of meshes with too many faces, are faults."""
    found: list[Fault] = []
    surfaces = surfaces_of(scene)
    for name, of in scene.contacts.items():
        key = f"contacts.{name}"
        if faceted := _faceted([surfaces[each] for each in of.surfaces]):
            faults.append(fault("many faces", key, faceted, most=MOST_FACES))
            continue
        site, depth, hard = Site(scene, of, SceneLevel()), 0.0, of.stiffness is None
        for point in _points(scene, *(surfaces[each] for each in of.surfaces)):
            (one, two), (frame1, frame2) = point.bodies, point.frames
            depth = max(depth, -float(point.gap.distance(site.between(one, frame1, two, frame2))))
        told = f"{' and '.join(of.surfaces)} {depth:.3g} m deep in each other"
        sheets = [sheet for name in of.surfaces if (sheet := shells_of(scene).get(surfaces[name].body)) is not None]
        size = min([length, *(float(np.ptp(sheet.mesh().points, axis=0).max()) for sheet in sheets)])
        if hard and depth > OVERLAP * size:
            faults.append(fault("hard overlap", key, told))
        elif depth > DEEP * size:
            found.append(fault("overlap", key, told, most=DEEP * size))
    return found


def _faceted(pair: list[Surface]) -> str:
    """The mesh of a pair that has too many faces and edges to meet the other surface."""
    if not any(each.kind == "plane" for each in pair):
        for each in pair:
            if each.kind == "mesh" and (count := faces_and_edges(each.shape["mesh"])) > MOST_FACES:
                return f"{each.name} with {count} faces and edges or more"
    return ""
