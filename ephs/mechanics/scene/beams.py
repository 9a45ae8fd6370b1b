"""Beams of a scene file as bodies and joints: lumped nodes, and between them six-degree-of-freedom joints with strain
energy.

The nodes of the beam ``rod`` are the bodies ``rod.0`` … ``rod.n`` of a part; its elements are the joints ``rod-1`` …
``rod-n``, its welds ``rod-start`` and ``rod-end``. The reference curve is a helix on each segment between two points,
so a beam through points of a circle is that circle, whatever the number of its elements.

A rod that neither stretches nor shears (Kirchhoff's) has rigid pieces for its nodes, which meet in the middle of its
elements by spherical joints: their energy is ½ θᵀ (K/L) θ of the rotation vector θ. A string has no such energy, and
pivots where its ends are held.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.conduction import Conduction
from ephs.mechanics.scene.element import FREE_END
from ephs.mechanics.scene.errors import shown
from ephs.mechanics.scene.flexible import Beam, Strain
from ephs.mechanics.scene.geometry import body_twist
from ephs.mechanics.scene.joints import Asked, Joint, bare_joint
from ephs.mechanics.scene.model import ENVIRONMENT, IDENTITY_POSE, Body, Scene, World, frozen
from ephs.mechanics.scene.resolve_elements import ReferableNames
from ephs.mechanics.scene.sections import Section, resolve_section
from ephs.mechanics.scene.surfaces import Surface
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.rank import TINY

ALONG = 1.0 - 1e-9
"""Cosine above which a given direction counts as along the beam: its sine is 4e-5, well above rounding."""

PARALLEL = 0.9
"""Cosine above which a world axis counts as along a tangent, and the next one is taken for ``up``."""
ALIKE = 1e-9
"""Relative difference up to which neighbouring elements count as equally long."""
NOISE = 1e-12
"""Strains of a reference curve below this part of the largest are rounding."""
MOST_ELEMENTS = 100_000
_TURNED = float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0
"""A rotation from axis z, that of cylinders and capsules, to the tangent."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class BeamDraft:
    """A beam with its nodes as a scene, its elements and welds as joints yet to be measured, its heat."""

    beam: Beam
    nodes: Scene
    joints: tuple[tuple[Joint, Asked], ...]
    thermal: dict[str, ThermalNode]
    conduction: dict[str, Conduction]


def check_beam(table: Checked[Any], names: ReferableNames) -> None:
    """Append a fault where a beam's end or heat leads nowhere; ``names`` have the nodes of all beams."""
    entry = table.entry
    if table.sound("heat", "thermal") and entry.thermal is not None and entry.heat != ENVIRONMENT:
        table.fault("beam heat", "heat")
    elif table.sound("heat"):
        names.check(table, entry.heat, "heat", "node")
    if table.sound("surface") and entry.surface is not None and entry.surface.heat is not None:
        names.check(table, entry.surface.heat, "surface.heat", "node")
    for i, end in enumerate(entry.ends if table.sound("ends") else ()):
        names.check(table, end, f"ends[{i}]", "end")


def resolve_beam(table: Checked[Any], world: World) -> BeamDraft | None:
    """A beam's bodies and joints; None where its place or section is invalid."""
    entry, name = table.entry, table.name
    ends = [*entry.ends, *[FREE_END] * (2 - len(entry.ends))]
    given = table.inner("section", entry.section)
    section = resolve_section(given, entry.rod) if table.sound("section", "rod") else None
    placed = _placed(table)
    _check_kind(table)
    touching = entry.surface if table.sound("section", "surface") else None
    if touching is not None and not (touching.radius or _radius(entry.section)):
        table.fault("rod radius", "surface.radius", "nothing")
        return None
    if section is None or placed is None:
        return None
    frames, shapes = placed
    n = len(frames) - 1
    lengths = np.array([float(np.linalg.norm(shape[3:])) for shape in shapes])
    initial = np.array(entry.strain or np.zeros(6))
    make = _element if entry.rod == "reissner" else _hinge
    joints: list[tuple[Joint, Asked]] = []
    for i, shape in enumerate(shapes):
        own, ends_of = f"{name}-{i + 1}", (f"{name}.{i}", f"{name}.{i + 1}")
        if i and shape is shapes[i - 1]:
            element = replace(joints[-1][0], name=own, body1=ends_of[0], body2=ends_of[1])
        else:
            element = make(own, ends_of, _settled(shape / lengths[i]), float(lengths[i]), initial, section, entry)
        joints.append((element if entry.thermal is None else replace(element, heat=own), Asked()))
    held = "spherical" if entry.rod == "string" else "fixed"
    for end, node, side in ((ends[0], 0, "start"), (ends[1], n, "end")):
        if end != FREE_END:
            at = frames[node]
            joints.append((_joint(f"{name}-{side}", held, (end, f"{name}.{node}"), at, at), Asked(in_bodies=False)))
    hinged = tuple(lengths.tolist()) if entry.rod != "reissner" else ()
    sink = entry.surface.heat if entry.surface else None
    beam = Beam(name, n, (ends[0], ends[1]), section.outline, hinged, sink)
    nodes = _nodes(name, entry, section, frames, lengths, world)
    return BeamDraft(beam, nodes, tuple(joints), *_warmth(beam, entry, lengths, float(section.stiffness[3])))


def _warmth(
    beam: Beam, entry: Any, lengths: Array, axial: float
) -> tuple[dict[str, ThermalNode], dict[str, Conduction]]:
    """A store of heat for each element, and conduction between the middles of neighbours; ``axial``: EA in N."""
    given = entry.thermal
    if given is None:
        return {}, {}
    of = dict(zip(beam.joints, lengths.tolist(), strict=True))
    kept = given.temperature, axial * given.expansion, given.reference or given.temperature
    nodes = {name: ThermalNode(name, given.capacity * length, *kept) for name, length in of.items()}
    ways = {
        one: Conduction.model_construct(
            between=[one, other], conductance=given.conduction / (0.5 * (of[one] + of[other]))
        ).called(one)
        for one, other in pairwise(beam.joints)
    }
    return nodes, ways if given.conduction else {}


def _check_kind(table: Checked[Any]) -> None:
    """Rigid pieces have strain energy of torsion and bending, those of strings none; order 2."""
    entry = table.entry
    if not table.sound("rod", "order", "strain", "damping", "thermal") or entry.rod == "reissner":
        return
    if entry.thermal is not None and entry.thermal.expansion:
        table.fault("rod expansion", "thermal.expansion", rod=entry.rod)
    strain = np.array(entry.strain or np.zeros(6))
    if entry.order != 2:
        table.fault("rod order", "order", rod=entry.rod)
    if np.any(strain[3 if entry.rod == "kirchhoff" else 0 :]):
        table.fault("rod strain", "strain", rod=entry.rod)
    if entry.rod == "string" and entry.damping:
        table.fault("string damping", "damping")


def _element(
    name: str, bodies: tuple[str, str], shape: Array, length: float, initial: Array, section: Section, entry: Any
) -> Joint:
    """A geometrically exact element; ``shape`` (6,) is the strain of its reference curve, stretch 1."""
    rest = shape - initial
    strain = Strain(length, frozen(section.stiffness), frozen(rest), entry.damping, entry.order)
    return _joint(name, "free", bodies, SE3.exp(length * rest), IDENTITY_POSE, entry.heat, strain)


def _hinge(
    name: str, bodies: tuple[str, str], shape: Array, length: float, initial: Array, section: Section, entry: Any
) -> Joint:
    """A spherical joint in the middle of an element, its frames one another's half a rotation away from rest."""
    half = SE3.exp(0.5 * length * shape)
    turn = SE3.exp(np.append(0.5 * length * initial[:3], np.zeros(3)))
    frames = SE3.compose(half, SE3.inverse(turn)), SE3.compose(SE3.inverse(half), turn)
    joint = _joint(name, "spherical", bodies, *frames, entry.heat)
    if entry.rod == "string":
        return joint
    stiffness = section.stiffness[:3] / length
    return replace(joint, stiffness=frozen(stiffness), friction=frozen(np.diag(entry.damping * stiffness)))


def _nodes(name: str, entry: Any, section: Section, frames: list[Array], lengths: Array, world: World) -> Scene:
    """The part with the nodes: their shares of the length are the weights of a quadrature of the elements' order.

    Rigid pieces turn as rods, about their nodes, where the mass is; others have the inertia of their section. Nothing
    tells how pieces of a string spin about themselves: their inertia against it is a tenth of that across.
    """
    share = _shares(lengths, entry.order)
    sides = np.append(lengths, 0.0), np.insert(lengths, 0, 0.0)
    swing = section.mass / 24.0 * (sides[0] ** 3 + sides[1] ** 3)
    way = {"reissner": np.zeros(3), "kirchhoff": np.array([0.0, 1.0, 1.0]), "string": np.array([0.1, 1.0, 1.0])}
    speed, spin = np.array(entry.velocity or np.zeros(3)), np.array(entry.angular_velocity or np.zeros(3))
    places = np.array(frames)[:, 4:]
    velocities = speed + np.cross(spin, places - places[0])
    bodies: dict[str, Body] = {}
    for i, (pose, length, velocity) in enumerate(zip(frames, share, velocities, strict=True)):
        twist = body_twist(pose, velocity, so3.quaternion_to_matrix(pose[:4]).T @ spin)
        back = 0.5 * lengths[i - 1] if i else 0.0
        bodies[str(i)] = Body(
            str(i), section.mass * length, frozen(np.diag(section.inertia * length + swing[i] * way[entry.rod])),
            frozen(pose), frozen(twist),
            _shape(section.outline, float(length), float(0.5 * length - back)),
        )  # fmt: skip
    return Scene(name, world, bodies, surfaces=_surfaces(entry, sides))


def _surfaces(entry: Any, sides: tuple[Array, Array]) -> dict[str, Surface]:
    """Capsules about the nodes' pieces, which reach half the elements on either side, where the beam has a surface."""
    if entry.surface is None:
        return {}
    radius = entry.surface.radius or _radius(entry.section)
    law = entry.surface.model_dump(exclude={"radius", "heat"})
    found: dict[str, Surface] = {}
    for i, (ahead, behind) in enumerate(np.array(sides).T.tolist()):
        shape, at = {"capsule": [radius, 0.5 * (ahead + behind)]}, [0.25 * (ahead - behind), 0.0, 0.0]
        found[str(i)] = Surface(body=str(i), shape=shape, position=at, rotation=list(_TURNED), **law).called(str(i))
    return found


def _radius(section: Any) -> float | None:
    """Radius of a round section, else None."""
    return section.circle or (section.tube[0] if section.tube else None)


def _shares(lengths: Array, order: int) -> Array:
    """Lengths that the nodes carry: half an element on either side; at order 4 by Gregory's rule.

    That rule has the weights 3/8, 7/6, 23/24, 1, 1, … from either end of a run of equal elements, so that mass, centre
    of mass and moments of inertia of a straight beam are right. Fewer than two equal elements keep their halves.
    """
    out = 0.5 * (np.append(lengths, 0.0) + np.insert(lengths, 0, 0.0))
    if order == 2:
        return out
    ends = [0, *(np.flatnonzero(np.abs(np.diff(lengths)) > ALIKE * lengths[1:]) + 1).tolist(), lengths.size]
    for start, stop in pairwise(ends):
        if stop - start > 1:
            change = np.array([-1.0 / 8.0, 1.0 / 6.0, -1.0 / 24.0]) * lengths[start]
            out[start : start + 3] += change
            out[stop - 2 : stop + 1] += change[::-1]
    return out


def _shape(outline: tuple[float, ...], length: float, shift: float) -> dict[str, Any]:
    """A piece of the beam about its node, for pictures."""
    place = {"position": [shift, 0.0, 0.0]}
    if len(outline) == 2:
        return {"box": [length, *outline], **place}
    return {"cylinder": [outline[0], length], **place, "rotation": list(_TURNED)}


def _joint(
    name: str, kind: str, bodies: tuple[str, str], frame1: Array, frame2: Array, heat: str = ENVIRONMENT,
    strain: Strain | None = None,
) -> Joint:  # fmt: skip
    """A joint of a beam, its coordinates and rates yet to be measured."""
    zero = frozen(np.zeros({"free": 6, "spherical": 3, "fixed": 0}[kind]))
    return replace(bare_joint(name, kind, bodies, (frame1, frame2), zero, zero), heat=heat, strain=strain)


def _settled(strain: Array) -> Array:
    """The strain with rounded zeros set to zero."""
    return np.where(np.abs(strain) <= NOISE * np.abs(strain).max(), 0.0, strain)


def _placed(table: Checked[Any]) -> tuple[list[Array], list[Array]] | None:
    """Result of `curve` of a table; None, with a fault, where they cannot be told."""
    entry = table.entry
    if not table.sound("from", "to", "points", "up", "elements"):
        return None
    ends = getattr(entry, "from"), entry.to
    if (entry.points is None) == (ends == (None, None)) or (ends != (None, None) and None in ends):
        given = [word for word in ("from", "to", "points") if getattr(entry, word) is not None]
        table.fault("beam place", found=" and ".join(given) or "nothing that says where the beam is")
        return None
    points = np.array(entry.points if entry.points is not None else ends, dtype=float)
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    short = np.flatnonzero(gaps <= NOISE * max(float(np.abs(points).max()), TINY))
    if short.size:
        where = f"points[{short[0] + 1}]" if entry.points is not None else "to"
        table.fault("beam points", where, shown(points[short[0] + 1].tolist()))
        return None
    segments = len(points) - 1
    elements = entry.elements or segments
    if elements % segments or elements > MOST_ELEMENTS:
        table.fault("beam elements", "elements", elements, segments=segments, most=MOST_ELEMENTS)
        return None
    found = curve(points, None if entry.up is None else np.array(entry.up), elements)
    if found is None:
        table.fault("up", "up", "nothing" if entry.up is None else None)
    return found


def curve(points: Array, up: Array | None, elements: int) -> tuple[list[Array], list[Array]] | None:
    """Nodes on a curve through points (k, 3), axis 1 along it, axis 2 as near ``up`` as can be.

    Gives the poses (7,) of the nodes and the logarithms (6,) of the elements between them, the same for equal ones.

    Between two points the curve is a helix, cut into equal elements. Where ``up`` is None it is the first of the
    world's axes z, y, x that is along no tangent; None where ``up`` is along one.
    """
    tangents = _tangents(points)
    ways = [up] if up is not None else [np.eye(3)[i] for i in (2, 1, 0)]
    most = ALONG if up is not None else PARALLEL
    fits = [u / np.linalg.norm(u) for u in ways if np.linalg.norm(u) > 0.0]
    chosen = next((u for u in fits if np.abs(tangents @ u).max() <= most), None)
    if chosen is None:
        return None
    corners = [_frame(point, tangent, chosen) for point, tangent in zip(points, tangents, strict=True)]
    cut = elements // (len(points) - 1)
    frames, shapes = [corners[0]], list[Array]()
    for one, two in pairwise(corners):
        along = SE3.log(SE3.compose(SE3.inverse(one), two))
        frames += [SE3.retract(one, along * (i / cut)) for i in range(1, cut)]
        frames.append(two)
        shapes += [along / cut] * cut
    return frames, shapes


def _tangents(points: Array) -> Array:
    """Unit tangents at points: of the circle through three neighbours, so that circles are met exactly."""
    sides = np.diff(points, axis=0)
    if len(points) == 2:
        return np.repeat(sides / np.linalg.norm(sides), 2, axis=0)
    found = np.zeros_like(points)
    squares = np.sum(sides * sides, axis=1)
    for i in range(1, len(points) - 1):
        found[i] = sides[i - 1] / squares[i - 1] + sides[i] / squares[i]
    found[1:-1] /= np.linalg.norm(found[1:-1], axis=1)[:, None]
    for end, near, side in ((0, 1, sides[0]), (-1, -2, sides[-1])):  # the chord halves the turn between its tangents
        way = side / np.linalg.norm(side)
        found[end] = 2.0 * (way @ found[near]) * way - found[near]
    return found


def _frame(point: Array, tangent: Array, up: Array) -> Array:
    second = up - (up @ tangent) * tangent
    second /= np.linalg.norm(second)
    rotation = np.column_stack([tangent, second, np.cross(tangent, second)])
    return np.concatenate([so3.matrix_to_quaternion(rotation), point])
