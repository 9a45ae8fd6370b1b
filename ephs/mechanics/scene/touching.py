"""Surfaces, contacts and limits of joints in a scene file.

Shapes are checked, laws of pairs put together, and pairs found where none are named.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.entries import Checked, Document, shown
from ephs.mechanics.scene.errors import Fault, fault, unknown
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, IDENTITY_POSE, Joint, Scene, frozen
from ephs.mechanics.scene.polytope import MOST_FACES, corners_of, faces_and_edges, vertices_of
from ephs.mechanics.scene.resolve import Names, mesh_file
from ephs.mechanics.scene.schema import JointEntry
from ephs.mechanics.scene.schema_touching import ContactEntry, ContactLawEntry, SurfaceEntry
from ephs.mechanics.scene.state import Snapshot
from ephs.mechanics.scene.surfaces import Contact, Surface
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law
from ephs.mechanics.shapes.pairs import PAIRS, touches
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.spaces import SE3

Laws = Mapping[str, ContactLawEntry]
STIFF = 1e4
"""Stiffness of stops by default, in M (L ω)² of the scene's mass, length and rate: what falls by its length presses a
stop by 1/70 rad, or of its length."""
LOSS = 0.1
"""Loss of stops by default, s/rad or s/m."""
SOFT = ("stiffness", "exponent", "loss", "slip", "rolling", "spinning")
HARD = ("restitution", "tangential")
"""Keys of elastic surfaces that hard ones do not have, and of hard ones."""
DEEP = 1e-2
"""Least reported overlap at the start, as a fraction of the mechanism's length, or of a radian."""
OVERLAP = 1e-9
"""Likewise for hard surfaces, for which it is refused."""


def resolve_surfaces(document: Document, names: Names, folder: Path, faults: list[Fault]) -> dict[str, Surface]:
    """The surfaces of a file, their bodies and shapes checked."""
    found: dict[str, Surface] = {}
    for name, table in document.sections["surfaces"].items():
        entry, key = table.entry, f"surfaces.{name}"
        if table.sound("body"):
            names.check(entry.body, f"{key}.body", "body", faults)
        if table.sound("heat") and entry.heat is not None:
            names.check(entry.heat, f"{key}.heat", "thermal", faults)
        pose = values.pose(entry.position, entry.rotation, key, faults)
        _unmixed(entry, key, faults)
        shape = _shape(table, key, folder, faults)
        if shape is not None:
            found[name] = Surface(name, entry.body, shape, frozen(pose))
    return found


def _unmixed(entry: ContactLawEntry, key: str, faults: list[Fault]) -> None:
    """Append the fault of a table with keys of both elastic and hard surfaces."""
    hard, soft = ([name for name in names if getattr(entry, name) is not None] for names in (HARD, SOFT))
    if hard and soft:
        faults.append(fault("hard and soft", key, f"{hard[0]} and {soft[0]}", soft=soft[0]))


def _shape(table: Checked[SurfaceEntry], key: str, folder: Path, faults: list[Fault]) -> Mapping[str, Any] | None:
    if not table.sound("shape"):
        return None
    given = {kind: sizes for kind, sizes in table.entry.shape.model_dump().items() if sizes is not None}
    if len(given) != 1 or given.get("plane"):
        faults.append(fault("surface shape", f"{key}.shape", " and ".join(given) or "an empty table"))
        return None
    if "mesh" in given:
        file = mesh_file(given["mesh"], folder)
        if file is None:
            faults.append(fault("mesh", f"{key}.shape.mesh", shown(given["mesh"])))
            return None
        try:
            return {"mesh": vertices_of(file).tolist()}
        except (ValueError, OSError) as error:
            faults.append(fault("convex mesh", f"{key}.shape.mesh", f"{file.name}, {error}"))
            return None
    if "points" in given:
        try:
            return {"mesh": corners_of(np.array(given["points"])).tolist()}
        except ValueError as error:
            faults.append(fault("solid points", f"{key}.shape.points", str(error)))
            return None
    return given


def with_stops(document: Document, scene: Scene, faults: list[Fault]) -> Scene:
    """The scene with the limits of its own joints."""
    found = dict(scene.joints)
    for name, table in document.sections["joints"].items():
        entry, key = table.entry, f"joints.{name}"
        sound = table.sound("limits", "limit_stiffness", "limit_loss", "limit_restitution")
        if entry.limits is None or not sound or name not in found:
            continue
        joint = found[name]
        if joint.dim != 1 or joint.motion is not None:
            what = "a joint with a prescribed motion" if joint.motion is not None else f"a {joint.kind} joint"
            faults.append(fault("limited joint", f"{key}.limits", what))
            continue
        if (law := _stop(scene, joint, entry, key, faults)) is not None:
            found[name] = replace(joint, limits=frozen(entry.limits), stop=law)
    return replace(scene, joints=found)


def _stop(scene: Scene, joint: Joint, entry: JointEntry, key: str, faults: list[Fault]) -> Law | Impact | None:
    """The law of a joint's stops, or None and a fault."""
    if entry.limit_restitution is not None:
        soft = [name for name in ("limit_stiffness", "limit_loss") if getattr(entry, name) is not None]
        if soft:
            faults.append(fault("hard and soft", key, f"limit_restitution and {soft[0]}", soft=soft[0]))
            return None
        return Impact(entry.limit_restitution)
    stiffness = entry.limit_stiffness or _stiffness(scene, joint)
    if not stiffness:
        faults.append(fault("no scale", f"{key}.limit_stiffness", "nothing"))
        return None
    return Law(stiffness=stiffness, loss=LOSS if entry.limit_loss is None else entry.limit_loss)


def _stiffness(scene: Scene, joint: Joint) -> float:
    """Default stiffness of a joint's stops, N m/rad or N/m; 0 where the scene has no rate of its own."""
    scale = Snapshot.of(scene).scale(scene.world.gravity)
    mass = sum(body.mass for _, body in scene.all_bodies())
    return float(STIFF * mass * scale.rate**2 * (scale.length**2 if _turns(joint) else 1.0))


def _turns(joint: Joint) -> bool:
    """Whether the coordinate of a joint with one degree of freedom is an angle."""
    return bool(np.any(coupling_of(joint).basis(joint.coordinate)[:3]))


def overlaps(scene: Scene, faults: list[Fault]) -> list[Fault]:
    """Surfaces that overlap at the start by more than a part of the scene's length, and joints beyond their stops by
    more than this part of a radian or of the length; hard ones are faults."""
    touched = bool(scene.contacts) or any(joint.limits is not None for _, joint in scene.all_joints())
    length = Snapshot.of(scene).scale(scene.world.gravity).length if touched else 1.0
    found: list[Fault] = []
    for name, joint in scene.all_joints():
        if joint.limits is None:
            continue
        at, (lower, upper) = float(joint.coordinate[0]), joint.limits.tolist()
        beyond, key = float(np.nanmax([lower - at, at - upper])), f"joints.{name}.limits"
        if isinstance(joint.stop, Impact) and beyond > OVERLAP:
            faults.append(fault("beyond stop", key, f"a start {beyond:.3g} beyond them"))
        elif beyond > (most := DEEP * (1.0 if _turns(joint) else length)):
            found.append(fault("beyond soft stop", key, f"a start {beyond:.3g} beyond them", most=most))
    surfaces = dict(scene.all_surfaces())
    poses = {GROUND: IDENTITY_POSE} | {name: body.pose for name, body in scene.all_bodies()}
    for name, contact in scene.contacts.items():
        one, other = (surfaces[each] for each in contact.surfaces)
        if faceted := _faceted(contact.surfaces, one, other):
            faults.append(fault("many faces", f"contacts.{name}", faceted, most=MOST_FACES))
            continue
        touching, swapped = touches(one.shape, one.frame, other.shape, other.frame)
        bodies = (other.body, one.body) if swapped else (one.body, other.body)
        depth = 0.0
        for frame1, frame2, gap in touching:
            first, second = SE3.compose(poses[bodies[0]], frame1), SE3.compose(poses[bodies[1]], frame2)
            depth = max(depth, -float(gap.distance(SE3.compose(SE3.inverse(first), second))))
        hard = isinstance(contact.law, Impact)
        if depth > (OVERLAP if hard else DEEP) * length:
            pair = " and ".join(contact.surfaces)
            told = f"{pair} {depth:.3g} m deep in each other"
            key = f"contacts.{name}"
            (faults if hard else found).append(
                fault("hard overlap", key, told) if hard else fault("overlap", key, told, most=DEEP * length)
            )
    return found


def _faceted(names: tuple[str, str], one: Surface, other: Surface) -> str:
    """The mesh of a pair that has too many faces and edges to meet the other surface."""
    if "plane" in one.shape or "plane" in other.shape:
        return ""
    for name, surface in zip(names, (one, other), strict=True):
        if "mesh" in surface.shape and (count := faces_and_edges(surface.shape["mesh"])) > MOST_FACES:
            return f"{name} with {count} faces and edges or more"
    return ""


def resolve_contacts(
    document: Document, scene: Scene, below: Mapping[str, Laws], names: Names, faults: list[Fault]
) -> tuple[dict[str, Contact], Laws]:
    """The contacts of a file, and the laws of all surfaces by dotted name.

    Parameters
    ----------
    scene
        With its surfaces, joints and parts.
    below
        Laws of the surfaces of each part.
    """
    laws: dict[str, ContactLawEntry] = {n: t.entry for n, t in document.sections["surfaces"].items()}
    laws |= {f"{part}.{name}": law for part, inner in below.items() for name, law in inner.items()}
    surfaces = dict(scene.all_surfaces())
    found: dict[str, Contact] = {}
    rigid, pairs = _rigid(scene), dict[frozenset[str], str]()
    tables = document.sections["contacts"]
    for name, table in tables.items():
        key = f"contacts.{name}"
        if table.sound("heat") and table.entry.heat is not None:
            names.check(table.entry.heat, f"{key}.heat", "thermal", faults)
        _unmixed(table.entry, key, faults)
        if table.sound("surfaces") and _paired(table, name, surfaces, rigid, pairs, faults):
            one, other = (surfaces[each] for each in table.entry.surfaces)
            _add(found, name, key, one, other, (table.entry, laws[one.name], laws[other.name]), faults)
    if not tables:
        groups = {n: t.entry.group for n, t in document.sections["surfaces"].items() if t.entry.group is not None}
        for one, other in _meeting(scene, surfaces, groups, rigid):
            name = f"{one.name}_{other.name}".replace(".", "_")
            key = f"surfaces.{one.name} and surfaces.{other.name}"
            _add(found, name, key, one, other, (laws[one.name], laws[other.name]), faults)
    return found, laws


def _paired(
    table: Checked[ContactEntry],
    name: str,
    surfaces: Mapping[str, Surface],
    rigid: DisjointSets[str],
    pairs: dict[frozenset[str], str],
    faults: list[Fault],
) -> bool:
    """Whether a contact has surfaces of two bodies that can move, and is the first of this pair."""
    key, given = f"contacts.{name}.surfaces", table.entry.surfaces
    for i, surface in enumerate(given):
        if surface not in surfaces:
            faults.append(unknown("surface", f"{key}[{i}]", surface, surfaces))
            return False
    one, other = (surfaces[surface].body for surface in given)
    if len(pair := frozenset(given)) < 2:
        faults.append(fault("contact bodies", key, f'"{given[0]}" twice'))
    elif one == other:
        faults.append(fault("contact bodies", key, f'two surfaces of "{one}"'))
    elif rigid.leader(one) == rigid.leader(other):
        faults.append(fault("contact still", key, f'surfaces of "{one}" and "{other}", which fixed joints connect'))
    elif (first := pairs.setdefault(pair, name)) != name:
        faults.append(fault("contact twice", key, f"the surfaces of contacts.{first}"))
    else:
        return True
    return False


def _add(
    found: dict[str, Contact],
    name: str,
    key: str,
    one: Surface,
    other: Surface,
    laws: tuple[ContactLawEntry, ...],
    faults: list[Fault],
) -> None:
    """Add a contact, or the fault of its pair."""
    kinds = next(iter(one.shape)), next(iter(other.shape))
    if kinds not in PAIRS and kinds[::-1] not in PAIRS:
        faults.append(fault("surface pair", key, f"a {kinds[0]} and a {kinds[1]}"))
    elif (law := _law(laws, key, faults)) is not None:
        sinks = [each.heat for each in laws if each.heat is not None]
        found[name] = Contact(name, (one.name, other.name), law, sinks[0] if sinks else ENVIRONMENT)


def _law(laws: tuple[ContactLawEntry, ...], key: str, faults: list[Fault]) -> Law | Impact | None:
    """The law of a pair: the contact's values, else stiffness of both surfaces in series, the smaller friction, the
    larger of other numbers, and one exponent. A surface with restitution is hard if the other has no stiffness."""
    *own, first, second = laws
    if (hard := _hard(laws)) is not None:
        return hard
    both = first, second

    def given(name: str) -> list[float]:
        said = [value for each in own if (value := getattr(each, name)) is not None]
        return said or [value for each in both if (value := getattr(each, name)) is not None]

    exponents, soft, frictions = set(given("exponent")) or {1.0}, given("stiffness"), given("friction")
    if len(exponents) > 1:
        faults.append(fault("two exponents", key, " and ".join(f"{n:g}" for n in sorted(exponents))))
        return None
    if not soft:
        faults.append(fault("no stiffness", key, "two surfaces without stiffness"))
        return None
    (n,) = exponents
    more = {name: max(given(name)) for name in ("loss", "slip", "rolling", "spinning") if given(name)}
    stiffness = sum(k ** (-1.0 / n) for k in soft) ** -n if len(soft) > 1 else soft[0]
    return Law(stiffness=float(stiffness), exponent=n, friction=min(frictions, default=0.0), **more)


def _hard(laws: tuple[ContactLawEntry, ...]) -> Impact | None:
    """The law of a hard pair: the contact's values, else the lesser number of both; None for an elastic pair."""
    *own, first, second = laws

    def given(name: str) -> list[float]:
        said = [value for each in own if (value := getattr(each, name)) is not None]
        return said or [value for each in (first, second) if (value := getattr(each, name)) is not None]

    said = [each for each in own if each.restitution is not None or each.stiffness is not None] or [first, second]
    if any(each.stiffness is not None for each in said) or all(each.restitution is None for each in said):
        return None
    tangential = min(given("tangential"), default=None)
    return Impact(min(given("restitution")), min(given("friction"), default=0.0), tangential)


def _rigid(scene: Scene) -> DisjointSets[str]:
    """Bodies, and the ground, in sets that fixed joints connect."""
    sets = DisjointSets[str]()
    for _, joint in scene.all_joints():
        if joint.kind == "fixed":
            sets.join(joint.body1, joint.body2)
    return sets


def _meeting(
    scene: Scene, surfaces: Mapping[str, Surface], groups: Mapping[str, str], rigid: DisjointSets[str]
) -> Iterator[tuple[Surface, Surface]]:
    """Pairs of surfaces on different bodies without a common joint but a free one, which fixed joints do not connect,
    and not of the same group or part; of a beam's pieces those further apart along it than half a circle of its radius:
    nearer ones cannot touch."""
    for beam in scene.beams.values():
        pieces = [surfaces[node] for node in beam.nodes if node in surfaces]
        sizes = np.array([piece.shape["capsule"] for piece in pieces]).reshape(-1, 2)
        upto = np.append(0.0, np.cumsum(sizes[:, 1]))
        for i, j in combinations(range(len(pieces)), 2):
            if upto[j] - upto[i + 1] > np.pi * sizes[i, 0]:
                yield pieces[i], pieces[j]
    joined = {frozenset((j.body1, j.body2)) for _, j in scene.all_joints() if j.kind != "free"}
    level = [[each] for name, each in surfaces.items() if "." not in name]
    level += [[each for name, each in surfaces.items() if name.startswith(f"{part}.")] for part in scene.parts]
    for some, others in combinations(level, 2):
        for one, other in product(some, others):
            apart = rigid.leader(one.body) != rigid.leader(other.body)
            apart = apart and frozenset((one.body, other.body)) not in joined
            if apart and (one.name not in groups or groups[one.name] != groups.get(other.name)):
                yield one, other
