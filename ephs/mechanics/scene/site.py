"""Site of an element of one's own in a scene: values that it reads there, and boxes that it adds to the system."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.elements.components import joint_momentum
from ephs.mechanics.scene.bodies import IDENTITY_POSE
from ephs.mechanics.scene.element import AXIS, ENVIRONMENT, GROUND, SINGLE
from ephs.mechanics.scene.geometry import coupling_of
from ephs.operad import Path, Quantity, junction, quantity
from ephs.semantics import library
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces import SE3, translation
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.systems.kept import once
from ephs.semantics.systems.system import Filling, System
from ephs.solve.posing.problem import Signal

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.scene.bodies import Body
    from ephs.mechanics.scene.custom import Element
    from ephs.mechanics.scene.model import Scene
    from ephs.mechanics.scene.shells import ShellSheet
    from ephs.mechanics.scene.surfaces import Surface

Start = Callable[["Site"], "Mapping[str, ArrayLike]"]
INPUTS = "inputs"
"""First name of the outer ports of elements."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class SceneLevel:
    """Junctions, boxes and inputs of a level of a scene's system.

    Attributes
    ----------
    inputs
        Outer ports -> the names of their inputs, empty where runs have none, and their values without these.
    starts
        Boxes -> their elements, and what makes their states at the start.
    moving
        Elements that read the motion of bodies or joints for what is no such state.
    """

    junctions: dict[Path, Any] = field(default_factory=dict)
    boxes: dict[Path, dict[Any, str]] = field(default_factory=dict)
    fillings: dict[Path, Filling] = field(default_factory=dict)
    inputs: dict[Path, tuple[str, Signal]] = field(default_factory=dict)
    starts: "dict[Path, tuple[Element, Start]]" = field(default_factory=dict)
    moving: set[str] = field(default_factory=set)

    def join(self, group: str, name: str, of: Quantity, *, exposed: bool = False) -> str:
        """The junction of a (dotted) name in a group."""
        path = Path([group, *name.split(".")])
        self.junctions[path] = junction(of, exposed=exposed)
        return str(path)

    def momentum(self, body: str) -> str:
        """The junction of a body's momentum."""
        return self.join("momenta", body, quantity.body_momentum)

    def entropy(self, node: str) -> str:
        """The junction of a thermal node, or of the environment."""
        return self.join("entropies", node, quantity.entropy)

    def add(self, path: Path, filling: Filling, ports: Mapping[Any, str]) -> None:
        """A box with its filling."""
        self.boxes[path], self.fillings[path] = dict(ports), filling


@final
@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """Place of an element in a scene, with access to poses, junctions and boxes.

    Attributes
    ----------
    scene
        The scene or part with the element: names are as seen from there.
    element
        It, in the units in which it is built.
    """

    scene: "Scene"
    element: "Element"
    _level: SceneLevel = field(default_factory=SceneLevel)

    @property
    def _origin(self) -> Array:
        """(7,) pose in the world of the ground on which the element's points are: those with a frame are placed."""
        return IDENTITY_POSE if type(self.element).frames else self.scene.origin

    # ---- what it may read ----------------------------------------------------------------------------------------

    @property
    def gravity(self) -> Array:
        """(3,) in the world, m/s²."""
        return self.scene.world.gravity

    def pose(self, body: str) -> Array:
        """(7,) of a body, or a node of a shell, in the world at the start; of the ground the identity."""
        if body == GROUND:
            return IDENTITY_POSE
        self._level.moving.add(self.element.name)
        return self._body(body).pose

    def twist(self, body: str) -> Array:
        """(6,) of a body, or a node of a shell, at the start, in its frame; of the ground 0."""
        self._level.moving.add(self.element.name)
        return np.zeros(6) if body == GROUND else self._body(body).twist

    def _body(self, name: str) -> "Body":
        return nodes_of_shells(self.scene).get(name) or self.scene.body(name)

    def rate(self, joint: str) -> Array:
        """(d,) u_r of a joint at the start; rad/s, m/s."""
        self._level.moving.add(self.element.name)
        return self.scene.joint(joint).rate

    def point(self, body: str, at: "ArrayLike") -> Array:
        """(3,) a point of a body in its frame, of the ground in the world, m: a part's own ground may be moved."""
        given = np.array(at, dtype=float)
        return SE3.compose(self._origin, translation(given))[4:] if body == GROUND else given

    def direction(self, along: "ArrayLike") -> Array:
        """(3,) in the world, of a direction in world axes of the element's file: a part may be turned."""
        return quaternion_to_matrix(self.scene.origin[:4]) @ np.array(along, dtype=float)

    def in_world(self, body: str, at: "ArrayLike") -> Array:
        """(3,) where a point, as the table has it, is in the world at the start; m."""
        return SE3.compose(self.pose(body), translation(self.point(body, at)))[4:]

    def between(self, body1: str, at1: "ArrayLike", body2: str, at2: "ArrayLike") -> Array:
        """(7,) at the start, pose of the frame at a point (3,) of body 2, or that is a pose (7,) in it, in that of
        body 1."""
        frames = [
            SE3.compose(self.pose(body), translation(self.point(body, at)) if np.size(at) == 3 else np.asarray(at))
            for body, at in ((body1, at1), (body2, at2))
        ]
        return SE3.normalise(SE3.compose(SE3.inverse(frames[0]), frames[1]))

    # ---- junctions -----------------------------------------------------------------------------------------------

    def momentum(self, body: str) -> str:
        """The junction of the momentum of a body, or of a node of a shell; the ground has one, too."""
        own = body.startswith(f"{self.element.name}.")  # nodes of a shell
        if body != GROUND and not own and body not in nodes_of_shells(self.scene):
            self._known("body", "end", "side", name=body)
        return self._level.momentum(body)

    def entropy(self, node: str = ENVIRONMENT) -> str:
        """The junction of a thermal node, or of the environment: heat goes there."""
        if node != ENVIRONMENT:
            self._known("node", name=node)
        return self._level.entropy(node)

    def heated(self, node: str) -> dict[str, str]:
        """The port s of a box at the junction of a thermal node; none at the environment, which such a box contains."""
        return {} if node == ENVIRONMENT else {"s": self.entropy(node)}

    def drive(self, joint: str) -> str:
        """The junction of the momentum of a joint that a key of kind ``axis`` names."""
        self._known(AXIS, SINGLE, name=joint)
        return self._level.join("drives", joint, self.quantity(joint))

    def quantity(self, joint: str) -> Quantity:
        """The quantity at `drive`."""
        return joint_momentum(coupling_of(self.scene.joint(joint)).pair)

    def inner(self, name: str, of: Quantity) -> str:
        """A junction of its own."""
        section, *own = self._own(name)
        return self._level.join(section, ".".join(own), of)

    def input(
        self,
        of: Quantity,
        value: "ArrayLike" = 0.0,
        port: str = "",
        *,
        at: str = INPUTS,
        effort: bool = True,
        named: bool = True,
    ) -> str:
        """A junction that an input of runs drives, ``"SECTION.NAME"`` or with ``.PORT``.

        Parameters
        ----------
        value
            The effort or flow where no input is given: a number, or one for each dimension.
        at
            Another first name of the outer port than ``inputs``; then ``"SECTION.NAME"`` drives all of them in a row.
        named
            Whether runs may drive it; else other elements act there.
        """
        section, *own = self._own(port)
        path = self._level.join(at, ".".join([section, *own] if at == INPUTS else own), of, exposed=True)
        given = np.broadcast_to(np.asarray(value, dtype=float), (of.space.dim,)).copy()
        name = str(self._own(port if at == INPUTS else "")) if named else ""
        self._level.inputs[Path.of(path)] = name, Signal(given, effort=effort)
        return path

    # ---- boxes ---------------------------------------------------------------------------------------------------

    def add(
        self,
        filling: Filling,
        ports: Mapping[str, str],
        box: str = "",
        *,
        initial: "Mapping[str, ArrayLike] | Start | None" = None,
    ) -> None:
        """A box ``SECTION.NAME``, or with ``.BOX`` where there are several.

        Parameters
        ----------
        filling
            A `System` or a component.
        ports
            Its ports -> junctions, as the methods above give them.
        initial
            States at the start by their paths in the filling, of what it does not carry and that is not zero; or a
            function of the site that makes them, with which scenes in other states may have the same system.
        """
        path = self._own(box)
        if callable(initial):
            self._level.starts[path] = self.element, initial
            initial = started(self.scene, self.element, initial)
        if initial and isinstance(filling, System | Storage):
            filling = filling.with_initial({name: np.asarray(value, dtype=float) for name, value in initial.items()})
        self._level.add(path, filling, ports)

    def _own(self, name: str) -> Path:
        return Path([self.element.section, self.element.name, *(name.split(".") if name else ())])

    def _known(self, *kinds: str, name: str) -> None:
        """Only what keys name is connected: parts expose no other junctions."""
        named = [each for kind in kinds for each in self.element.named(kind)]
        if "body" in kinds:
            shells = shells_of(self.scene)
            for carrier in (surfaces_of(self.scene)[each].body for each in self.element.named("surface")):
                named += shells[carrier].named("side") if carrier in shells else [carrier]
        if name not in named:
            expected = f"one that its keys name: {', '.join(named) or 'there is none'}"
            raise AssemblyError("unnamed", self._own(""), found=f"the {kinds[0]} {name}", expected=expected)


def surfaces_of(scene: "Scene") -> "Mapping[str, Surface]":
    """Surfaces by dotted name; made once and kept with the scene."""
    return once(scene, "surfaces", lambda: dict(scene.all_surfaces()))


def shells_of(scene: "Scene") -> "Mapping[str, ShellSheet]":
    """Shells by dotted name; made once and kept with the scene."""
    return once(scene, "shells", lambda: dict(scene.all_shells()))


def nodes_of_shells(scene: "Scene") -> "Mapping[str, Body]":
    """Nodes of shells that are welded to nothing, as bodies by their names; made once and kept with the scene."""

    def made() -> "dict[str, Body]":
        return {name: node for sheet in shells_of(scene).values() for name, node in sheet.bodies().items()}

    return once(scene, "nodes of shells", made)


def started(scene: "Scene", element: "Element", start: Start) -> "Mapping[str, ArrayLike]":
    """States of an element's box at the start, by their paths in the filling."""
    return start(Site(scene, element))


def moved(scene: "Scene", other: "Scene") -> "Scene":
    """A scene that shares its system with another one where all elements are the same, as its parts do: see `form_of`.

    Bodies and joints may differ in their motion at the start, and in nothing else.
    """
    levels = [(own, before) for (_, own), (_, before) in zip(scene.levels(), other.levels(), strict=True)]
    for own, before in levels:
        below = zip(own.levels(), before.levels(), strict=True)
        if all(_same_elements(one, like) for (_, one), (_, like) in below):
            once(own, "like", lambda before=before: once(before, "like", lambda: before))
    return scene


def _same_elements(scene: "Scene", other: "Scene") -> bool:
    """Whether two levels have the same world and the same elements but for bodies and joints, none of one's own."""
    from ephs.mechanics.scene.model import ELEMENTS

    own = [(scene.section(key), other.section(key)) for key in ELEMENTS if key not in ("bodies", "joints")]
    same = all(a.keys() == b.keys() and all(a[name] is b[name] for name in a) for a, b in own)
    return same and scene.world is other.world and not scene.elements


def form_of(scene: "Scene") -> "Scene":
    """The scene that a scene shares its system with: itself, or one that differs in motion at the start alone."""
    like = once(scene, "like", lambda: scene)
    return scene if like is scene or any(_elements(level).moving for _, level in like.levels()) else like


def built(scene: "Scene") -> SceneLevel:
    """Junctions, boxes and inputs of the elements of a level, made once for all scenes that share them.

    States at the start in its fillings may be those of another scene: ``starts`` makes those of this one.
    """
    return _elements(form_of(scene))


def _elements(scene: "Scene") -> SceneLevel:
    from ephs.mechanics.scene.model import elements_of

    def made() -> SceneLevel:
        level = SceneLevel()
        for of in elements_of(scene):
            of.build(Site(scene, of, level))
        if Path(["entropies", ENVIRONMENT]) in level.junctions:
            level.add(Path([ENVIRONMENT]), library.environment(), {"s": level.entropy(ENVIRONMENT)})
        return level

    return once(scene, "elements", made)
