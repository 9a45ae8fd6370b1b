"""Elements of one's own: the keys of their tables, rules about these, and the boxes that they become in a system.

A key's annotation is its form and range; `key` gives its meaning, its unit, and the kind of what it names. Reading with
all faults at once, result files, JSON schema and pages, parameter paths, other units and names seen from outside of a
part follow from these.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self, final

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, ValidationError

from ephs.mechanics.scene.element import GROUND, OUTSIDE, NumberForm, SceneElement
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.rules import KeyRule
from ephs.mechanics.scene.schema_numbers import EntryTable
from ephs.mechanics.scene.units import dimension, written
from ephs.operad import Path as Name
from ephs.operad import PatternError
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rotations import quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.scene.site import Site

_TEXTS: Final[Mapping[str, tuple[str, str]]] = {
    "class": ("a subclass of ephs.mechanics.Element", "derive it from Element"),
    "section": ("section= in the class statement, a name of letters, digits and underscores", "add it"),
    "taken": ("a section that scene files do not have yet", "choose another name"),
    "build": ("a method build(self, site)", "write what it adds to a system"),
    "key": ("a key made by key(meaning, …)", "give its meaning, and the unit of a number"),
    "reserved": ("a key that is not an attribute of elements", "rename it"),
    "form": ("a number, a text, true or false, or a list of these", "take several keys instead of tables in a table"),
    "unit": ('unit= of each number, "1" where it has none', "give its unit"),
    "symbols": ("a unit such as N m/rad, kg m², m³/(s Pa)", "correct the unit"),
    "names": (f"names= one of {', '.join(OUTSIDE)}, of a text or a list of texts", "correct it"),
    "rule": ("a rule of keys of this class", "name these keys"),
    "validator": ("rules instead of pydantic's validators", "write a method with @rule, which has its own texts"),
}


class ElementError(ValueError):
    """A class that cannot be registered: where, what was found, what was expected, what to do."""

    def __init__(self, code: str, where: str, found: object) -> None:
        expected, advice = _TEXTS[code]
        super().__init__(f"{where}: found {found}, expected {expected}; {advice}")


def key(
    meaning: str,
    default: Any = ...,
    *,
    unit: str = "",
    shown: str | None = None,
    names: str = "",
    frame: str = "",
    **more: Any,
) -> Any:
    """A key of an element's table; it is required where it has no default.

    Parameters
    ----------
    meaning
        In words. The unit stands where it has ``{}``, else at the end.
    unit
        Of a number, or of each in a list: it is a parameter of sweeps and fits, and changes with units. ``"1"`` where
        it has no dimension; ``q`` is the unit of the coordinate of the joint that the table names first, ``qᵢ`` of a
        list that of each joint's own, from the last one on.
    shown
        The unit as the page has it; default: as above, with ``rad or m`` for ``q``.
    names
        Kind of the elements that it names: ``body``, ``node`` (of heat), ``joint``, ``axis`` (a joint with one free
        degree of freedom), ``single`` (with one, free or prescribed), ``tendon``, ``surface``.
    frame
        Of a point: the key of the body in whose frame it is, or on the ground in the world; ``bodies[1]`` of a list, of
        a list of points that of a list with a body for each. Points of the ground move with the part that has them.
    more
        Bounds, as of pydantic's ``Field``: ``ge``, ``gt``, ``le``, ``lt``, ``min_length``, ``max_length``.
    """
    said = shown if shown is not None else written(unit) if unit else ""
    text = meaning.format(said) if "{}" in meaning else ", ".join(filter(None, (meaning, said)))
    return Field(default=default, description=text, json_schema_extra=_hidden(unit, names, frame), **more)


@final
@dataclass(frozen=True, slots=True)
class _Hidden:
    """Unit, references and frame of a key; they are not shown to editors."""

    unit: str = ""
    names: str = ""
    frame: str = ""

    def __call__(self, schema: dict[str, Any]) -> None:
        """Leave the schema as it is."""


def _hidden(*given: str) -> Any:
    return _Hidden(*given)


class Element(EntryTable, SceneElement):
    """Base of elements of one's own: subclass it with keys, rules and ``build``, and call `register_element`.

    The class statement names the section of scene files, and says what stands there:
    ``class Drag(Element, section="drags", said="air drag on bodies")``.

    Attributes
    ----------
    section, said
        Of the class: the section, and what stands there.
    name
        The element's name, as seen from its scene.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False, ignored_types=(KeyRule,))
    section: ClassVar[str] = ""
    said: ClassVar[str] = ""
    rules: ClassVar[tuple[KeyRule, ...]] = ()
    _name: str = PrivateAttr("")
    _folder: Path = PrivateAttr(Path())
    """Folder of the scene file, for files that it names."""

    def __init_subclass__(cls, **_: str) -> None:
        super().__init_subclass__()

    @classmethod
    def __pydantic_init_subclass__(cls, *, section: str = "", said: str = "", **_: Any) -> None:
        cls.section, cls.said = section or cls.section, said or cls.said
        own = tuple(each for each in vars(cls).values() if isinstance(each, KeyRule))
        cls.rules = (*cls.rules, *own)
        extras = {name: _extra(field.json_schema_extra) for name, field in cls.model_fields.items()}
        cls.names = {name: of.names for name, of in extras.items() if of.names}
        cls.numbers = dimensions(cls)
        cls.frames = {name: of.frame for name, of in extras.items() if of.frame}
        cls.__doc__ = f"``[{cls.section}.NAME]``\n\n{cls.__doc__ or ''}"

    @property
    def name(self) -> str:
        """Its name."""
        return self._name

    @abstractmethod
    def build(self, site: "Site") -> None:
        """Add its boxes to the system of its scene."""

    def lines(self, site: "Site") -> Iterator[tuple[str, Any, str, Any]]:
        """Lines of its picture: body, point (3,), body, point (3,), each point in the frame of its body."""
        return iter(())

    def continued(self, states: Mapping[str, Array]) -> Self:
        """The element that starts in states of its boxes, by their paths below ``SECTION.NAME``: see `Scene.at`."""
        return self

    @classmethod
    def of_table(cls, name: str, table: Mapping[str, Any]) -> Self:
        """The element of a sound table.

        Raises
        ------
        ValueError
            The table is not sound.
        """
        try:
            found = cls.model_validate({key: value for key, value in cls._upgraded(table).items() if key != "name"})
        except ValidationError as error:
            where, what = error.errors(include_url=False)[0]["loc"], error.errors(include_url=False)[0]["msg"]
            raise ValueError(f"{cls.section}.{name}.{'.'.join(map(str, where))}: {what}") from None
        return found.normalised().called(name)

    @classmethod
    def _upgraded(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """The table of an older result file with the keys of today."""
        return table

    def normalised(self) -> Self:
        """Itself with one number written as a list where it may be both, and the like."""
        return self

    def settled(self, site: "Site") -> Self:
        """Itself with values for keys whose default depends on where bodies are."""
        return self

    def called(self, name: str) -> Self:
        """Itself with a name."""
        found = self.model_copy()
        found._name = name
        return found

    def changed(self, **keys: Any) -> Self:
        return self.model_copy(update=keys)

    def _inside(self, path: str) -> Self:
        return self.called(path + self.name)

    def number_values(self) -> dict[str, Any]:
        """Its numbers by key."""
        return {name: getattr(self, name) for name in type(self).numbers}

    def _carriers(self, name: str) -> list[str]:
        """The bodies in whose frames the points at a key are."""
        of, _, index = type(self).frames[name].partition("[")
        given = getattr(self, of)
        return [given] if isinstance(given, str) else [given[int(index[:-1])]] if index else list(given)

    def moved(self, pose: Array) -> Self:
        """The same where the ground of its scene is moved by a pose (7,)."""
        turn, changes = quaternion_to_matrix(pose[:4]), dict[str, Any]()
        for name in type(self).frames:
            if getattr(self, name) is None:
                continue
            points = np.reshape(getattr(self, name), (-1, 3))
            for i, body in enumerate(self._carriers(name)):
                if body == GROUND:
                    points[i] = turn @ points[i] + pose[4:]
            changes[name] = np.reshape(points, np.shape(getattr(self, name))).tolist()
        return self.changed(**changes)

    def __str__(self) -> str:
        """In a few words."""
        return " – ".join(name for _, _, name in self.references()) or self.said


def read_in(element: Element, name: str, folder: Path = Path()) -> Element:
    """The element with a name, and while its file is read with the folder of this."""
    found = element.called(name)
    found._folder = folder
    return found


def _extra(given: Any) -> _Hidden:
    return given if isinstance(given, _Hidden) else _Hidden()


def dimensions(table: type[EntryTable]) -> dict[str, NumberForm]:
    """Keys of a table that are numbers, made by `key`, and their dimensions."""
    units = {name: _extra(field.json_schema_extra).unit for name, field in table.model_fields.items()}
    return {name: _dimension(f"{table.__name__}.{name}", unit) for name, unit in units.items() if unit}


def _dimension(where: str, unit: str) -> NumberForm:
    try:
        return dimension(unit)
    except ValueError as error:
        raise ElementError("symbols", where, str(error)) from None


def number_of(element: Element, key: str) -> Array:
    """The number or numbers at a key; none where it is not given."""
    given = getattr(element, key)
    return np.zeros(0) if given is None else np.asarray(given, dtype=float)


def register_element(kind: type[Element]) -> type[Element]:
    """Register elements of one's own: their section is read, checked, documented and built in all scenes from now on.

    It gives the class back, so that it serves as a decorator. Registering a class again after its definition was run
    again, as in a notebook, replaces it.

    Raises
    ------
    ElementError
        The section is taken, or the class is malformed; a ValueError.
    """
    if not (isinstance(kind, type) and issubclass(kind, Element)):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ElementError("class", getattr(kind, "__name__", "an object"), kind)
    who = kind.__name__
    if not kind.section.isidentifier():
        raise ElementError("section", who, f'"{kind.section}"')
    _check_section(kind)
    if kind.__abstractmethods__:
        raise ElementError("build", who, f"no {', '.join(sorted(kind.__abstractmethods__))}")
    _check_keys(kind)
    REGISTERED[kind.section] = kind
    return kind


def _check_section(kind: type[Element]) -> None:
    from ephs.mechanics.scene.schema import FILE_KEYS

    before = REGISTERED.get(kind.section)
    again = before is not None and (before.__module__, before.__qualname__) == (kind.__module__, kind.__qualname__)
    if kind.section in FILE_KEYS or (before is not None and not again):
        raise ElementError("taken", kind.__name__, f'"{kind.section}"')


def _check_keys(kind: type[Element]) -> None:
    decorators = kind.__pydantic_decorators__
    validators = [*decorators.model_validators, *decorators.field_validators, *decorators.validators]
    if validators:
        raise ElementError("validator", kind.__name__, ", ".join(validators))
    properties = kind.model_json_schema().get("properties", {})
    for name, field in kind.model_fields.items():
        where = f"{kind.__name__}.{name}"
        if name in dir(Element) or not is_name(name):
            raise ElementError("reserved", where, f'"{name}"')
        if field.description is None or not isinstance(field.json_schema_extra, _Hidden):
            raise ElementError("key", where, field.description or "no meaning")
        forms = _forms(properties[name])
        if not forms <= {"number", "integer", "string", "boolean", "null"} or not forms - {"null"}:
            raise ElementError("form", where, ", ".join(sorted(forms)))
        of = field.json_schema_extra
        if ("number" in forms) != bool(of.unit) and not ("integer" in forms and of.unit == "1"):
            raise ElementError("unit", where, f'unit "{of.unit}"')
        if of.names and (of.names not in OUTSIDE or forms - {"string", "null"}):
            raise ElementError("names", where, f'names "{of.names}"')
    for each in kind.rules:
        unknown = [name for name in (*each.keys, each.at.partition("[")[0]) if name and name not in kind.model_fields]
        if unknown:
            raise ElementError("rule", f"{kind.__name__}.{each.holds.__name__}", ", ".join(unknown))


def _forms(schema: Mapping[str, Any]) -> set[str]:
    """JSON types of what a key holds, in lists too."""
    if "anyOf" in schema:
        return {form for each in schema["anyOf"] for form in _forms(each)}
    if schema.get("type") == "array" and isinstance(schema.get("items"), Mapping):
        return _forms(schema["items"])
    if "enum" in schema or "const" in schema:
        values = schema.get("enum", [schema.get("const")])
        return {"string"} if all(isinstance(each, str) for each in values) else {"integer"}
    return {str(schema.get("type", "a table"))}


def is_name(text: str) -> bool:
    """Whether a text is one component of a path."""
    try:
        Name([text])
    except PatternError:
        return False
    return True
