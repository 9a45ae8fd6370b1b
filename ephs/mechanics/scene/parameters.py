"""Numbers of a model by path: read one, or make the model with other ones.

Paths of a scene are keys of its file, names in parts dotted: ``bodies.crank.mass``, ``bodies.left.crank.inertia[0]``,
``joints.pin.friction``, ``joints.pin.frame1.position[2]``, ``springs.s.length``, ``contacts.foot_floor.friction``,
``world.gravity[2]``, ``shells.skin.layers[0].E1``. Those of a system are its components' parameters, ``osc.pe.k``, and
its initial values by the paths of states, ``osc.pe.q``.

Positions mean what they mean in a file whose joints are given by ``at`` and ``axis``: a body's ``position`` moves its
centre of mass (with its axes, springs and markers) while its joints stay where they are in the world, a joint's ``at``
moves the joint. After a change of frames, coordinates or rates the bodies follow their joints as `Scene.with_state` has
it: joints keep what is not varied, unless they close a loop; then the nearest state that closes it is taken.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any, TypeVar, final

import numpy as np

from ephs.mechanics.scene.errors import Fault, SceneError, did_you_mean, fault, listing
from ephs.mechanics.scene.fields import FIELDS, NumberField, fields_of, placed
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.registry import REGISTERED
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.system import Filling, System
from ephs.solve.posing.errors import no_model

Model = TypeVar("Model", bound=Scene | System)
_INDEX = re.compile(r"((?:\[\d+\])*)$")
_TABLE = re.compile(r"(\[\d+\])\.(\w+)$")
"""Number of a table in a list, and its key."""


def read(model: Scene | System, path: str) -> float:
    """The number at a path.

    Raises
    ------
    SceneError, AssemblyError
        A scene, a system has no such number; the message names the nearest one.
    """
    if isinstance(model, System):
        if (start := _start(model, path)) is not None:
            return float(start[1][start[2]])
        return _component(model, path)[2]
    if not isinstance(model, Scene):
        raise no_model(model)
    return _ParameterTarget.of(model, path).read(model)


def varied(model: Model, values: Mapping[str, float], *, strict: bool = True) -> Model:
    """The model with other numbers at some paths, all else the same; loops of a scene closed.

    Parameters
    ----------
    values
        Path -> number, in the unit of the scene file or the component.
    strict
        Refuse what cannot be: numbers out of their range, an inertia that no mass distribution has unless the body had
        such a one. Differences by parameters look beyond such bounds.

    Raises
    ------
    SceneError
        With every fault: an unknown path, a number out of its range, a loop that does not close.
    AssemblyError, StructureError
        The same of a system's components.
    """
    if isinstance(model, System):
        return _system(model, values)
    return _scene(model, values, strict)


def names(model: Scene | System) -> list[str]:
    """All paths that `read` takes, entries of vectors one by one; of a system those of parameters."""
    if isinstance(model, System):
        return [f"{path}.{key}" for path, filling in model.leaves() for key in _numbers(filling)]
    return list(_paths(model))


# ---- scenes ------------------------------------------------------------------------------------------------------


@final
@dataclass(frozen=True, slots=True, eq=False)
class _ParameterTarget:
    """Target of a parameter path: object, field, and entry of the field."""

    path: str
    key: str
    name: str
    field: NumberField
    index: tuple[int, ...]

    @staticmethod
    def of(scene: Scene, path: str) -> "_ParameterTarget":
        table = bool(_TABLE.search(path))
        stem, index = _INDEX.split(_TABLE.sub(r".\2\1", path))[:2]
        entries = tuple(int(number) for number in re.findall(r"\d+", index))
        kind, _, rest = stem.partition(".")
        for key, field in fields_of(kind).items():
            if field.table != table:
                continue
            name = rest.removesuffix(key).removesuffix(".") if rest.endswith(key) else None
            if name is not None and (not name or rest == f"{name}.{key}") and _has(scene, kind, name):
                found = _ParameterTarget(path, key, name, field, entries)
                found.entry(field.get(scene, name), scene)
                return found
        raise _unknown(scene, path)

    def entry(self, values: Array, scene: Scene) -> Any:
        """Index in the field's array, or a slice if one number represents all of it."""
        if values.ndim == len(self.index) and all(i < n for i, n in zip(self.index, values.shape, strict=True)):
            return self.index
        if values.ndim == 2 and len(self.index) == 1 and self.index[0] < len(values):
            return self.index * 2
        if not self.index and (values.size == 1 or (self.field.spread and values.size)):
            return (slice(None),) * values.ndim if values.ndim < 2 else tuple(np.diag_indices(len(values)))
        shape = "".join(f"[0…{n - 1}]" for n in values.shape) if values.size else "of nothing: there is no such number"
        found = "".join(f"[{i}]" for i in self.index) or "no index"
        raise SceneError(scene.source or scene.name, [fault("entry", self.path, found, shape=shape)])

    def read(self, scene: Scene) -> float:
        """The number."""
        values = self.field.get(scene, self.name)
        if self.index:
            return float(values[self.entry(values, scene)])
        if not _uniform(values):
            raise SceneError(scene.source or scene.name, [fault("one number", self.path, values.tolist())])
        return float(values.flat[0])

    def put(self, scene: Scene, value: float) -> Scene:
        """The scene with another value of this number."""
        values = np.array(self.field.get(scene, self.name))
        entry = self.entry(values, scene)
        if values.ndim == 2 and not self.index:
            values[:] = 0.0
        values[entry] = value
        if values.ndim == 2 and len(self.index) == 2:
            values[self.index[::-1]] = value
        return self.field.put(scene, self.name, values)


def _scene(scene: Scene, values: Mapping[str, float], strict: bool) -> Scene:
    places = [_ParameterTarget.of(scene, path) for path in values]
    faults: list[Fault] = []
    found, coordinates, rates = scene, dict[str, Array](), dict[str, Array]()
    # The bodies' and joints' own numbers first: coordinates are then reached with them.
    for place in sorted(places, key=lambda place: place.field.moves == "state"):
        value = float(values[place.path])
        least = place.field.least
        if not np.isfinite(value):
            faults.append(fault("finite", place.path, value))
        elif strict and least is not None and not (value > least[0] if least[1] else value >= least[0]):
            faults.append(fault("range", place.path, value, what=f"a number {'>' if least[1] else '≥'} {least[0]:g}"))
        else:
            found = place.put(found, value)
    for place in places if strict else ():
        faults += place.field.faults(found, place.name, scene)
    if faults:
        raise SceneError(scene.source or scene.name, faults)
    for place in places:
        if place.key == "coordinate":
            coordinates[place.name] = place.field.get(found, place.name)
        elif place.field.moves == "state":
            rates[place.name] = found.joint(place.name).rate
    if any(place.field.moves for place in places):
        return placed(found, scene, coordinates, rates)
    return found


def _uniform(values: Array) -> bool:
    """Whether one number represents the array: all entries, or a multiple of the identity."""
    return bool(np.all(values == (values.flat[0] * np.eye(len(values)) if values.ndim == 2 else values.flat[0])))


def _has(scene: Scene, kind: str, name: str) -> bool:
    return not name if kind == "world" else name in dict(scene.every(kind))


def _paths(scene: Scene) -> Iterator[str]:
    for kind in (*FIELDS, *REGISTERED):
        fields = fields_of(kind)
        for name in ("",) if kind == "world" else dict(scene.every(kind)):
            for key, field in fields.items():
                stem = f"{kind}.{name}.{key}" if name else f"{kind}.{key}"
                values = field.get(scene, name)
                if field.table:
                    first, _, last = stem.rpartition(".")
                    yield from (f"{first}[{i}].{last}" for i in range(len(values)))
                    continue
                if values.size == 1 or (field.spread and values.size and _uniform(values)):
                    yield stem
                if values.ndim and values.size > 1:
                    yield from (f"{stem}[{']['.join(map(str, index))}]" for index in np.ndindex(values.shape))


def _unknown(scene: Scene, path: str) -> SceneError:
    known = list(_paths(scene))
    hint = did_you_mean(path, known, f"there are: {listing(known)}")
    return SceneError(scene.source or scene.name, [fault("unknown parameter", "", f'"{path}"', hint=hint)])


# ---- systems -----------------------------------------------------------------------------------------------------


def _library() -> dict[str, Callable[..., Filling]]:
    from ephs.semantics import library

    return {name: getattr(library, name) for name in library.__all__}


def _numbers(filling: Primitive) -> dict[str, float]:
    """Parameters of a library component that are numbers: not a reaction's equation."""
    entries: tuple[tuple[str, Any], ...] = filling.parameters if filling.name in _library() else ()
    return {key: float(value) for key, value in entries if isinstance(value, Real)}


def _start(system: System, path: str) -> tuple[Path, Array, int] | None:
    """State of a vector space, its values (size,) and the entry at a path; None where no state has this path."""
    stem, index = _INDEX.split(path)[:2]
    state = next((state for state in system.states if str(state) == stem), None)
    if state is None:
        return None
    of, values = system.states[state].space, system.state()[state]
    entries = [int(number) for number in re.findall(r"\d+", index)] or [0] * (of.size == 1)
    if of.size != of.dim or len(entries) != 1 or entries[0] >= of.size:
        shape = f"[0…{of.size - 1}]" if of.size == of.dim else "of a state on a vector space: this one is on a group"
        raise AssemblyError("entry", path, shape=shape)
    return state, values, entries[0]


def _component(system: System, path: str) -> tuple[Primitive, str, float]:
    """The component at a path, the parameter's name and its value."""
    box, _, key = path.rpartition(".")
    found = next((filling for at, filling in system.leaves() if str(at) == box), None)
    if found is not None and key in (parameters := _numbers(found)):
        return found, key, parameters[key]
    known = [*names(system), *map(str, system.states)]
    raise AssemblyError("unknown-parameter", path, hint=did_you_mean(path, known, f"there are: {listing(known)}"))


def _system(system: System, values: Mapping[str, float]) -> System:
    changes: dict[str, dict[str, float]] = {}
    starts: dict[Path, Array] = {}
    for path, value in values.items():
        if (start := _start(system, path)) is not None:
            starts.setdefault(start[0], start[1])[start[2]] = value
            continue
        _component(system, path)
        box, _, key = path.rpartition(".")
        changes.setdefault(box, {})[key] = float(value)
    found = _refilled(system, (), changes)
    return found.with_initial(starts) if starts else found


def _refilled(filling: Any, at: tuple[str, ...], changes: Mapping[str, Mapping[str, float]]) -> Any:
    """The filling of the box at a path with changed parameters of its components; the same object without changes."""
    if isinstance(filling, System):
        inner = {box: _refilled(of, (*at, *box), changes) for box, of in filling.fillings.items()}
        same = all(of is filling.fillings[box] for box, of in inner.items())
        return filling if same else System.of(filling.pattern, inner)
    parameters = changes.get(".".join(at))
    if parameters is None:
        return filling
    made = _library()[filling.name](**{**dict(filling.parameters), **parameters})
    return made.with_initial({str(p): x for p, x in filling.initial}) if isinstance(made, Storage) else made
