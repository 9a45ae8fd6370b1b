"""Resolved scene: every default, frame and coordinate as numbers.

Poses are 7-vectors ``[w, x, y, z, rx, ry, rz]``; twists are 6-vectors (angular, linear) in the body's own
frame. All arrays are read-only. Nothing here knows of files; `load` makes these values from them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar, final

from numpy.typing import ArrayLike

from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.adjustment import Adjustment
from ephs.mechanics.scene.bodies import IDENTITY_POSE, Body, World
from ephs.mechanics.scene.conduction import Conduction
from ephs.mechanics.scene.contacts import Contact
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.cylinders import Cylinder
from ephs.mechanics.scene.element import ENVIRONMENT, GROUND, SceneElement, frozen
from ephs.mechanics.scene.flexible import Beam
from ephs.mechanics.scene.gas_springs import GasSpring
from ephs.mechanics.scene.gears import Gear
from ephs.mechanics.scene.joints import Joint, free_joint
from ephs.mechanics.scene.loads import Load
from ephs.mechanics.scene.markers import Marker
from ephs.mechanics.scene.motors import Motor
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.scene.springs import Spring
from ephs.mechanics.scene.surfaces import Surface
from ephs.mechanics.scene.tendons import Tendon
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.kept import Kept

if TYPE_CHECKING:
    from ephs.semantics import System

__all__ = [
    "ELEMENTS",
    "ENVIRONMENT",
    "GROUND",
    "IDENTITY_POSE",
    "Body",
    "Joint",
    "Scene",
    "World",
    "free_joint",
    "frozen",
    "mapped",
]

T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A mechanism in its world: bodies, joints, springs, thermal nodes, and parts, which are scenes
    themselves.

    A part is a scene whose numbers are already in this scene's world. Names inside a scene are local to it;
    from outside, a part's names carry the part's name and a dot in front, at every level.

    Attributes
    ----------
    source : the file that it came from, or None
    adjusted : changes made by the assembly, or None if the initial state was consistent
    elements : elements of registered sections, by section and name
    origin : (7,) pose of a part's own ground in the world, in which ``elements`` have their numbers
    """

    name: str
    world: World
    bodies: Mapping[str, Body]
    joints: Mapping[str, Joint] = field(default_factory=dict)
    springs: Mapping[str, Spring] = field(default_factory=dict)
    thermal: Mapping[str, ThermalNode] = field(default_factory=dict)
    conduction: Mapping[str, Conduction] = field(default_factory=dict)
    parts: Mapping[str, "Scene"] = field(default_factory=dict)
    source: str | None = None
    adjusted: Adjustment | None = None
    markers: Mapping[str, Marker] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    beams: Mapping[str, Beam] = field(default_factory=dict)
    loads: Mapping[str, Load] = field(default_factory=dict)
    tendons: Mapping[str, Tendon] = field(default_factory=dict)
    motors: Mapping[str, Motor] = field(default_factory=dict)
    gears: Mapping[str, Gear] = field(default_factory=dict)
    cylinders: Mapping[str, Cylinder] = field(default_factory=dict)
    gas_springs: Mapping[str, GasSpring] = field(default_factory=dict)
    actuators: Mapping[str, Actuator] = field(default_factory=dict)
    shells: Mapping[str, ShellSheet] = field(default_factory=dict)
    elements: Mapping[str, Mapping[str, Element]] = field(default_factory=dict)
    origin: Array = field(default_factory=lambda: IDENTITY_POSE)
    _kept: Kept = field(default_factory=Kept, init=False, repr=False)

    def system(self, *, driven: Iterable[str] = ()) -> "System":
        """The scene as a hierarchical exergetic port-Hamiltonian system, in the scene's initial state.

        Drives, loads, voltages and pressures are inputs at its outer ports: ``drives.JOINT``, ``voltages.MOTOR``,
        ``momenta.BODY`` of bodies with loads and of nodes of shells with a pressure. The system has no values for them;
        a run has to give them. Its reference environment is that of `ephs.Reference` unless a run is given another one.

        Parameters
        ----------
        driven : names of joints that have a port ``drives.JOINT``, too, at which a larger system turns or moves them

        Raises
        ------
        SceneError
            The scene has no such joint.
        """
        from ephs.mechanics.scene.build import started_system

        return started_system(self, driven=driven)

    def with_state(
        self,
        coordinates: Mapping[str, ArrayLike] | None = None,
        rates: Mapping[str, ArrayLike] | None = None,
        *,
        adjust: bool = False,
    ) -> "Scene":
        """The scene in another initial state.

        Parameters
        ----------
        coordinates : joint name to its coordinates, a number or ``(d,)``; rotation vectors in the axes of
            C1. Joints that are not named keep theirs, unless they close a loop or rigid gears tie them to
            named ones. A body without a joint has an implicit free joint of its name.
        rates : joint name to its u_r, a number or ``(d,)``.
        adjust : take the nearest state that closes the loops, the named joints held.

        Raises
        ------
        SceneError
            A name is unknown, a value has the wrong length, or a loop does not close to 1e-8 of the mechanism's length.
        """
        from ephs.mechanics.scene.state import with_state

        return with_state(self, coordinates or {}, rates or {}, adjust)

    def at(self, solution: Any, time: float) -> "Scene":
        """The scene in the state of a solution at one of its times, temperatures, stretches and currents included.

        Velocities are those on the joints; what `natural` leaves the joints by is in ``scene.system().at(…)``.
        """
        from ephs.mechanics.scene.state import at_solution

        return at_solution(self, solution, time)

    def body(self, name: str) -> Body:
        """The body of this (dotted) name, its names seen from here."""
        return self._own("bodies", name) or _find(dict(self.all_bodies()), name, "body")

    def joint(self, name: str) -> Joint:
        """The joint of this (dotted) name, its names seen from here; the implicit free joint of a body
        without a joint too."""
        own = self._own("joints", name)
        return own or _find(dict(self.all_joints()) | dict(self.implicit_joints()), name, "joint")

    def section(self, name: str) -> Mapping[str, Any]:
        """The elements of a section of this level, registered ones included."""
        return getattr(self, name) if name in ELEMENTS else self.elements.get(name, {})

    def all_elements(self) -> Iterator[tuple[str, str, Element]]:
        """Section, dotted name and value of every element of registered sections; what it names is dotted, too."""
        for path, scene in self.levels():
            for section, own in scene.elements.items():
                for name, each in own.items():
                    yield section, path + name, each.seen(path)

    def every(self, section: str) -> Iterator[tuple[str, Any]]:
        """Dotted name and value of every element of a section, parts included; names in it are dotted, too."""
        for path, scene in self.levels():
            for each in scene.section(section).values():
                yield path + each.name, each.seen(path)

    def all_bodies(self) -> Iterator[tuple[str, Body]]:
        """Every body with its dotted name, parts included."""
        return self.every("bodies")

    def all_joints(self) -> Iterator[tuple[str, Joint]]:
        """Every joint with its dotted name; the bodies and heat sink that it names are dotted too."""
        return self.every("joints")

    def all_springs(self) -> Iterator[tuple[str, Spring]]:
        """Every spring with its dotted name, as `all_joints`."""
        return self.every("springs")

    def all_markers(self) -> Iterator[tuple[str, Marker]]:
        """Every marker with its dotted name."""
        return self.every("markers")

    def all_surfaces(self) -> Iterator[tuple[str, Surface]]:
        """Every surface with its dotted name."""
        return self.every("surfaces")

    def all_contacts(self) -> Iterator[tuple[str, Contact]]:
        """Every contact with its dotted name; its surfaces and heat sink are dotted too."""
        return self.every("contacts")

    def all_beams(self) -> Iterator[tuple[str, Beam]]:
        """Every beam with its dotted name."""
        return self.every("beams")

    def all_shells(self) -> Iterator[tuple[str, ShellSheet]]:
        """Every shell with its dotted name."""
        return self.every("shells")

    def all_loads(self) -> Iterator[tuple[str, Load]]:
        """Every load with its dotted name."""
        return self.every("loads")

    def all_tendons(self) -> Iterator[tuple[str, Tendon]]:
        """Every tendon with its dotted name; its bodies and heat sink are dotted too."""
        return self.every("tendons")

    def attachments(self) -> Iterator[tuple[str, str, Element]]:
        """Section, name and value of every attachment of this level: motors, gears, cylinders, actuators, …"""
        for section in ATTACHED:
            for name, each in self.section(section).items():
                yield section, name, each

    def all_attachments(self) -> Iterator[tuple[str, str, Element]]:
        """Section, dotted name and value of every attachment; its joints and heat sink are dotted too."""
        for path, scene in self.levels():
            for section, name, each in scene.attachments():
                yield section, path + name, each.seen(path)

    def all_thermal(self) -> Iterator[tuple[str, ThermalNode]]:
        """Every thermal node with its dotted name."""
        return self.every("thermal")

    def all_conduction(self) -> Iterator[tuple[str, Conduction]]:
        """Every conduction with its dotted name, as `all_joints`."""
        return self.every("conduction")

    def implicit_joints(self) -> Iterator[tuple[str, Joint]]:
        """The free joints of the bodies that no joint holds; each has its body's name, both frames are the
        identity."""
        held = {name for _, j in self.all_joints() for name in (j.body1, j.body2)}
        for name, body in self.all_bodies():
            if name not in held:
                yield name, free_joint(body)

    def __repr__(self) -> str:
        from ephs.mechanics.scene.words import scene_text

        return scene_text(self)

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.mechanics.scene.words import scene_html

        return scene_html(self)

    def _own(self, section: str, name: str) -> Any:
        """The element of a section that a dotted name leads to, its names seen from here, or None."""
        *parts, own = name.split(".")
        scene: Scene | None = self
        for part in parts:
            scene = None if scene is None else scene.parts.get(part)
        found = None if scene is None else scene.section(section).get(own)
        return None if found is None else found.seen(name[: len(name) - len(own)])

    def levels(self, path: str = "") -> Iterator[tuple[str, "Scene"]]:
        """The scene and all its parts, each with the path to it, empty or with a dot at its end."""
        yield path, self
        for name, part in self.parts.items():
            yield from part.levels(f"{path}{name}.")


ATTACHED: Mapping[str, type[Element]] = {of.section: of for of in (Motor, Gear, Cylinder, GasSpring, Actuator)}
"""Attachments of joints, by their sections."""
ELEMENTS: Mapping[str, type[SceneElement]] = {
    "bodies": Body,
    "joints": Joint,
    "springs": Spring,
    "surfaces": Surface,
    "contacts": Contact,
    "beams": Beam,
    "shells": ShellSheet,
    "tendons": Tendon,
    "loads": Load,
    **ATTACHED,
    "thermal": ThermalNode,
    "conduction": Conduction,
    "markers": Marker,
}
"""Sections of a scene -> what stands in them, in the order of the page of keys."""
KINDS: Mapping[str, type[Element]] = {key: kind for key, kind in ELEMENTS.items() if issubclass(kind, Element)}
"""Those whose elements build themselves, as registered ones do."""


def elements_of(scene: Scene) -> Iterator[Element]:
    """The elements of a level that build themselves."""
    for own in (*(scene.section(key) for key in KINDS), *scene.elements.values()):
        yield from own.values()


def mapped(
    scene: Scene,
    changes: Mapping[str, Callable[[str, Any], Any]],
    world: World | None = None,
    path: str = "",
    *,
    origin: Callable[[Array], Array] = frozen,
) -> Scene:
    """The scene with its elements changed, parts included, and in another world where one is given.

    ``changes`` has, by section, a function that gives the changed element from the path of its level, empty or with a
    dot at its end, and the element; ``origin`` gives a level's pose (7,) from what it was.
    """
    made = {
        section: {name: change(path, each) for name, each in own.items()}
        for section, change in changes.items()
        if (own := scene.section(section))
    }
    parts = {name: mapped(part, changes, world, f"{path}{name}.", origin=origin) for name, part in scene.parts.items()}
    return with_sections(scene, made, parts=parts, world=world or scene.world, origin=origin(scene.origin))


def with_sections(scene: Scene, sections: Mapping[str, Mapping[str, Any]], **more: Any) -> Scene:
    """The scene with other elements in some sections, registered ones included."""
    own = {name: each for name, each in sections.items() if name not in ELEMENTS}
    fixed: dict[str, Any] = {name: each for name, each in sections.items() if name in ELEMENTS}
    return replace(scene, elements={**scene.elements, **own}, **fixed, **more)


def _find(values: Mapping[str, T], name: str, what: str) -> T:
    if name in values:
        return values[name]
    from ephs.mechanics.scene.errors import unknown_name

    raise unknown_name(what, name, values)
