"""Shells: sheets of one section on a grid or a mesh, in elements whose nodes are bodies."""

from collections.abc import Mapping
from typing import Annotated, Any, Self, final

import numpy as np
from pydantic import Field, PrivateAttr, TypeAdapter, WrapValidator, model_validator

from ephs.mechanics.elements.shell.section import ShellSection
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.scene.bodies import Body
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import ENVIRONMENT, FREE_END, GROUND, POSE, TWIST, frozen
from ephs.mechanics.scene.errors import TEXTS, shown
from ephs.mechanics.scene.faces import Faces
from ephs.mechanics.scene.layers import Layers, laminate, rescaled_layers
from ephs.mechanics.scene.meshes import MeshError, SheetMesh, mesh_of
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import Flag, NonNegative, Number, Positive, Text, Vector
from ephs.mechanics.scene.sheets import level_table
from ephs.mechanics.scene.site import Site
from ephs.mechanics.scene.text import file_inside
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

NEAR = 1e-6
"""Distance of a point from a node of a beam that is there, by the size of the sheet."""
_MATERIAL = ("thickness", "E", "nu", "rho")
_WAYS = ({"corners", "elements"}, {"points", "elements", "sides"}, {"file", "sides"})
_Count = Annotated[int, Field(strict=True, ge=1)]
_Node = Annotated[int, Field(strict=True, ge=0)]
_Grid = Annotated[list[_Count], Field(min_length=2, max_length=2)]
_Cells = list[Annotated[list[_Node], Field(min_length=3, max_length=4)]]
_GRID, _CELLS, _NODES, _NAME = TypeAdapter(_Grid), TypeAdapter(_Cells), TypeAdapter(list[_Node]), TypeAdapter(Text)


_Pose = Annotated[list[Number], Field(min_length=7, max_length=7)]
_Twist = Annotated[list[Number], Field(min_length=6, max_length=6)]


def _elements(value: Any, _handler: Any) -> Any:
    if value is None:
        return None
    rows = isinstance(value, list) and any(isinstance(row, list) for row in value)
    return (_CELLS if rows else _GRID).validate_python(value)


def _side(value: Any, _handler: Any) -> Any:
    return (_NAME if isinstance(value, str) else _NODES).validate_python(value)


Elements = Annotated[Any, WrapValidator(_elements, json_schema_input_type=_Grid | _Cells | None)]
Side = Annotated[Any, WrapValidator(_side, json_schema_input_type=Text | list[_Node])]


@final
class ShellSheet(Element, section="shells", said="sheets that bend and stretch"):
    """A shell of one section on a grid or a mesh, without stress and at rest where its points say nothing else."""

    corners: Annotated[list[Vector], Field(min_length=4, max_length=4)] | None = key(
        "of a grid: in the world, one after the other around the normal, m", None, frame="grounds"
    )
    elements: Elements = key(
        "of a grid: number along the first side, and along the second; of a mesh: three or four points of each", None
    )
    points: list[Vector] | None = key("of a mesh: in the world, m", None, frame="grounds")
    file: Text | None = key("mesh file in the folder of this file, or below; m, in the world", None)
    sides: list[Side] | None = key("of a mesh: points of each side, or the name of a set of points in the file", None)
    crease: Positive = key(
        "angle in degrees from the mean normal of its neighbours beyond which an element has its own at a corner", 30.0
    )
    thickness: Positive | None = key("of one material", None, unit="m")
    E: Positive | None = key("Young's modulus", None, unit="Pa")
    nu: Annotated[Number, Field(gt=-1.0, le=0.5)] | None = key("Poisson's ratio (default 0)", None, unit="1")
    rho: Positive | None = key("density", None, unit="kg/m³")
    layers: Layers | None = key("in place of these: layers from the lower side to the upper", None)
    along: Vector | None = key(
        "direction in the world from which angles of layers count; default: the element's first axis", None
    )
    damping: NonNegative = key("Kelvin–Voigt time, {}", 0.0, unit="s")
    spread: Flag = key("nodes turn about the normal with the inertia of elements' areas, for explicit methods", False)
    pressure: Number | None = key(
        'pressure below less that above, {}, along the normals as they turn; or the input "shells.NAME", in its place',
        None,
        unit="Pa",
    )
    edges: list[Text] = key(
        "what each side is joined to, of a grid from the first corner to the second and so on: a body, a beam of this "
        'file whose nodes are at its points, "ground" or "free"; default: free',
        [],
        names="side",
    )
    pinned: list[Flag] = key(
        "whether each side is pinned, so that its points are held and turn freely; default: welded", []
    )
    heat: Text = key("where the heat of damping goes: a thermal node", ENVIRONMENT, names="node")
    nodes: list[_Pose] | None = key(
        "poses of its points at the start, quaternion and m, in the world; default: without stress", None
    )
    twists: list[_Twist] | None = key("of its points at the start, in their axes, rad/s and m/s; default: 0", None)
    _read: SheetMesh | None = PrivateAttr(None)
    _one_level = model_validator(mode="before")(level_table)

    @rule(
        *_MATERIAL, "layers", at="", found="{found}", expected="thickness, E and rho, or layers with a density",
        advice="complete one of the two, and remove the other",
    )  # fmt: skip
    def made_of(self) -> Told:
        """Whether it has one material, or layers, and a mass."""
        given = [name for name in (*_MATERIAL, "layers") if getattr(self, name) is not None]
        if given != ["layers"] and not {"thickness", "E", "rho"} <= {*given} <= {*_MATERIAL}:
            return {"found": f"a table with {', '.join(given)}" if given else "a table without these"}
        return self.layers is None or any(layer["rho"] for layer in self.layers) or {"found": "layers without mass"}

    @rule("layers", found="{found}", expected="layers of possible materials", advice="correct it")
    def layered(self) -> Told:
        """Whether the numbers of its layers are in their ranges."""
        try:
            return self.layers is None or bool(laminate(self.layers))
        except StructureError as error:
            return {"found": str(error)}

    @rule(
        "corners", "elements", "points", "file", "sides", "edges", "pinned", "crease", *_MATERIAL, "layers", "along",
        at="{at}", found="{found}", expected="{expected}",
    )  # fmt: skip
    def sound(self) -> Told:
        """Whether it is on one grid or mesh, of elements of a shell."""
        try:
            self._read = self._meshed()
            sides, points = (len(self._read.sides), "side"), (len(self._read.points), "point")
            for at, (count, each) in {"edges": sides, "pinned": sides, "nodes": points, "twists": points}.items():
                if (given := getattr(self, at)) and len(given) != count:
                    raise MeshError(at, f"{len(given)} entries", f"{count} entries, one for each {each}")
            if not all(any(pose[:4]) for pose in self.nodes or ()):
                raise MeshError("nodes", "a quaternion 0", "quaternions of rotations")
            if self.made_of.holds(self) is True and self.layered.holds(self) is True:
                self.shell()
        except MeshError as error:
            return error.told
        except StructureError as error:
            at = next(name for name in ("corners", "points", "file") if getattr(self, name) is not None)
            return {"at": at, "found": str(error), "expected": "convex elements, nearly in a plane, turned alike"}
        return True

    @rule(
        "edges", at="{at}", placed=True, found="{found}", expected="a node of the beam at each point of the side",
        advice="give both the same number of elements between the same points",
    )  # fmt: skip
    def alongside(self, site: Site) -> Told:
        """Whether the beams along its sides have nodes at their points; those that have are not named any more."""
        for i, name in enumerate(self.edges):
            if name in site.scene.beams:
                far, _ = self._beside(site, i)
                node = int(far.argmax())
                return {"at": f"edges[{i}]", "found": f"{far[node]:.4g} m from a point to the next node of {name}"}
        return True

    def settled(self, site: Site) -> Self:
        """With each point of a side along a beam joined to the node of this there: on a mesh, whose sides they are."""
        sides, edges, ways = [], [], []
        given = zip(self.mesh().sides, self.edges, self.pinned or [False] * len(self.edges), strict=False)
        for i, (side, name, pinned) in enumerate(given):
            whole = [(list(side), name)]
            if name in site.scene.beams:
                far, at = self._beside(site, i)
                if far.max() <= NEAR * float(np.ptp(self.mesh().points, axis=0).max()):
                    whole = [([node], f"{name}.{k}") for node, k in zip(side, at.tolist(), strict=True)]
            sides += [nodes for nodes, _ in whole]
            edges += [body for _, body in whole]
            ways += [pinned] * len(whole)
        if edges == self.edges:
            return self
        mesh = self.mesh()
        found = self.changed(
            corners=None,
            points=mesh.points.tolist(),
            elements=mesh.cells.tolist(),
            sides=sides,
            edges=edges,
            pinned=ways,
        )
        found._read = None
        return found

    def _beside(self, site: Site, side: int) -> tuple[Array, Array]:
        """Distance of each point of a side from the nearest node of the beam that it names, and the number of this."""
        nodes = np.array([site.pose(name)[4:] for name in site.scene.beams[self.edges[side]].nodes])
        points = self.mesh().points[self.mesh().sides[side]]
        apart = np.linalg.norm(points[:, None] - nodes, axis=2)
        return apart.min(axis=1), apart.argmin(axis=1)

    def _meshed(self) -> SheetMesh:
        """Its grid, or its mesh of quadrilaterals.

        Raises
        ------
        MeshError
            There is none.
        """
        given = [name for name in ("corners", "points", "file", "elements", "sides") if getattr(self, name) is not None]
        if not any({*given} <= way and way - {*given} <= {"sides"} for way in _WAYS):
            found = f"a table with {', '.join(given)}" if given else "a table without these"
            raise MeshError("", found, "corners and elements, or points and elements, or a file")
        elements: Any = list(self.elements or ())
        rows = any(isinstance(row, list) for row in elements)
        if elements and rows != (self.points is not None):
            wanted = "points of each element" if self.points else "two numbers of elements"
            raise MeshError("elements", shown(elements), wanted)
        if self.corners is not None:
            return SheetMesh.of_corners(self.corners, elements)
        points, cells, sets = self._from_file() if self.file else (self.points or [], elements, {})
        chosen: list[list[int]] = []
        for i, side in enumerate(self.sides or ()):
            nodes = sets.get(side, [-1]) if isinstance(side, str) else side
            if not all(0 <= node < len(points) for node in nodes):
                names = f", or {', '.join(sets)}" if sets else ""
                raise MeshError(f"sides[{i}]", shown(side), f"points of 0 … {len(points) - 1}{names}")
            chosen.append(nodes)
        for i, cell in enumerate(cells):
            if not all(node < len(points) for node in cell):
                raise MeshError(f"elements[{i}]", str(cell), f"points of 0 … {len(points) - 1}")
        return SheetMesh.of_elements(points, cells, chosen)

    def _from_file(self) -> tuple[Any, list[list[int]], dict[str, list[int]]]:
        file = file_inside(self._folder / str(self.file), self._folder)
        if file is None:
            raise MeshError("file", shown(self.file), TEXTS["mesh"][0])
        try:
            return mesh_of(file)
        except ValueError as error:
            raise MeshError("file", f"{file.name}, a file {error}", "a mesh of quadrilaterals and triangles") from None

    def normalised(self) -> Self:
        try:
            mesh, found = self.mesh(), self
        except MeshError:  # of which a rule tells
            return self
        if self.corners is None:
            points, cells = mesh.points.tolist(), mesh.cells.tolist()
            found = self.changed(points=points, elements=cells, sides=mesh.sides, file=None)
        found._read = None
        return found

    @property
    def grounds(self) -> list[str]:
        """The ground for each corner or point: all are in the world."""
        return [GROUND] * len(self.corners or self.points or ())

    def moved(self, pose: Array) -> Self:
        found = super().moved(pose)
        turned = None if self.along is None else (quaternion_to_matrix(pose[:4]) @ self.along).tolist()
        nodes = None if self.nodes is None else [SE3.compose(pose, np.array(node)).tolist() for node in self.nodes]
        return found.changed(along=turned, nodes=nodes)

    def rescaled(self, length: float, mass: float, time: float, coordinates: tuple[float, ...] = ()) -> Self:
        found = super().rescaled(length, mass, time, coordinates)
        layers = None if self.layers is None else rescaled_layers(self.layers, length, mass, time)
        given = {"nodes": (self.nodes, POSE), "twists": (self.twists, TWIST)}
        units = length, mass, time, ()
        state = {name: rows and (np.array(rows) * of.unit(*units)).tolist() for name, (rows, of) in given.items()}
        return found.changed(layers=layers, **state)

    def continued(self, states: Mapping[str, Array]) -> Self:
        shell, (nodes, twists) = self.shell(), self.start()
        tensors = shell.tensors(spread=self.spread)
        for i in self.free():  # welded ones are where `carried` has them
            nodes[i], momentum = states[f"node{i}.pe.q"], states[f"node{i}.ke.p"]
            twists[i] = *np.linalg.solve(tensors[i], momentum[:3]), *(momentum[3:] / shell.inertia[i, 3:])
        return self.changed(nodes=nodes.tolist(), twists=twists.tolist())

    def carried(self, motions: Mapping[str, Array]) -> Self:
        """With the points that are joined to bodies, by name, carried by motions (7,) of these in the world."""
        nodes, _ = self.start()
        for pinned in (False, True):
            for body, own in self.joined(pinned=pinned).items():
                for i in own if body in motions else ():
                    moved = SE3.compose(motions[body], nodes[i])
                    nodes[i] = np.concatenate([nodes[i, :4], moved[4:]]) if pinned else moved
        return self.changed(nodes=nodes.tolist())

    # ---- what it is ----------------------------------------------------------------------------------------------

    def mesh(self) -> SheetMesh:
        """Its grid or mesh."""
        return self._read or self._meshed()

    def stack(self) -> ShellSection:
        """Section of its material or layers."""
        if self.layers is not None:
            return laminate(self.layers)
        assert self.thickness is not None
        assert self.E is not None
        assert self.rho is not None
        return ShellSection.isotropic(self.thickness, self.E, self.nu or 0.0, self.rho)

    def shell(self) -> Shell:
        """Its mesh without stress."""
        mesh = self.mesh()
        return Shell.of(mesh.points, mesh.cells, self.stack(), crease=float(np.radians(self.crease)), along=self.along)

    def start(self) -> tuple[Array, Array]:
        """(m, 7) poses and (m, 6) twists of its points at the start."""
        poses = self.shell().poses if self.nodes is None else np.array(self.nodes)
        poses[:, :4] /= np.linalg.norm(poses[:, :4], axis=1, keepdims=True)
        return poses, np.zeros((len(poses), 6)) if self.twists is None else np.array(self.twists)

    def joined(self, *, pinned: bool) -> Mapping[str, list[int]]:
        """Body, or the ground -> numbers of the nodes that are pinned or welded to it; of several the first side's."""
        sides = self.mesh().sides
        known: dict[int, tuple[str, bool]] = {}
        for body, way, nodes in zip(self.edges, self.pinned or [False] * len(self.edges), sides, strict=False):
            if body != FREE_END:
                known = dict.fromkeys(nodes, (body, way)) | known
        names = dict.fromkeys(body for body, way in known.values() if way == pinned)
        return {body: [node for node, at in known.items() if at == (body, pinned)] for body in names}

    def welds(self) -> Mapping[str, list[int]]:
        """Body, or the ground -> numbers of the nodes that are welded to it."""
        return self.joined(pinned=False)

    def free(self) -> list[int]:
        """Numbers of the nodes that are welded to nothing: bodies."""
        welded = {node for nodes in self.welds().values() for node in nodes}
        return [i for i in range(len(self.mesh().points)) if i not in welded]

    def moving(self) -> list[int]:
        """Numbers of the nodes that are not welded to the ground, where forces may act."""
        still = self.welds().get(GROUND, [])
        return [i for i in range(len(self.mesh().points)) if i not in still]

    def bodies(self) -> dict[str, Body]:
        """The nodes that are welded to nothing, as bodies by their names."""
        shell, (poses, twists) = self.shell(), self.start()
        tensors = shell.tensors(spread=self.spread)
        return {
            (name := self.node(i)): Body(
                name, float(shell.inertia[i, 3]), frozen(tensors[i]), frozen(poses[i]), frozen(twists[i])
            )
            for i in self.free()
        }

    def node(self, number: int) -> str:
        """Name of a node, as of a body."""
        return f"{self.name}.{number}"

    def faces(self, site: Site) -> Faces:
        """Its elements; of a scene whose nodes are no bodies where these are at the start."""
        poses = {GROUND: SE3.identity()} | {name: body.pose for name, body in site.scene.all_bodies()}
        at = self.start()[0]
        drawn = [(body, own) if body in poses else (GROUND, at[i]) for i, (body, own) in enumerate(self.ends(poses))]
        ends = tuple((body, pose[4:]) for body, pose in drawn)
        return Faces(ends, self.mesh().cells, frozenset(map(self.node, self.free())))

    def ends(self, poses: Mapping[str, Array]) -> list[tuple[str, Array]]:
        """The body of each node, its own where it is welded to none, and its pose (7,) there; of poses of bodies."""
        welded = {node: body for body, nodes in self.welds().items() for node in nodes}
        return [
            (welded[i], SE3.compose(SE3.inverse(poses[welded[i]]), at))
            if i in welded
            else (self.node(i), SE3.identity())
            for i, at in enumerate(self.start()[0])
        ]

    def build(self, site: Site) -> None:
        held, pinned = dict(self.welds()), self.joined(pinned=True)
        warm = site.heated(self.heat) if self.damping else {}
        ground = [*held.pop(GROUND, []), *pinned.get(GROUND, [])]
        bodies = [body for body in dict.fromkeys([*held, *pinned]) if body != GROUND]
        carried = {
            f"p_body{k}": (site.pose(body), [*held.get(body, []), *pinned.get(body, [])])
            for k, body in enumerate(bodies)
        }
        poses, twists = self.start()
        rods = {name for beam in site.scene.beams.values() for name in beam.nodes}
        fixed = [node for body in rods & held.keys() for node in held[body]]
        for body, nodes in [*pinned.items(), *held.items()]:  # they move with what carries them
            spin, speed = np.split(site.twist(body), 2)
            for i in nodes:
                off = SE3.compose(SE3.inverse(site.pose(body)), poses[i])
                back = quaternion_to_matrix(off[:4]).T
                twists[i, 3:] = back @ (speed + np.cross(spin, off[4:]))
                twists[i, :3] = back @ spin if body in held and i in held[body] else twists[i, :3]
        shared = self.moving()
        made = shell_system(
            self.shell(), gravity=site.gravity, damping=self.damping, held=ground, carried=carried,
            pinned=[node for nodes in pinned.values() for node in nodes], fixed=fixed, shared=shared, heat=bool(warm),
            spread=self.spread, start=(poses, twists),
        )  # fmt: skip
        ports = {port: site.momentum(body) for port, body in zip(carried, bodies, strict=True)}
        site.add(made, ports | {f"p{i}": site.momentum(self.node(i)) for i in shared} | warm)

    def __str__(self) -> str:
        shell = self.shell()
        return f"{len(shell.cells)} elements, {shell.section.thickness:g} m"
