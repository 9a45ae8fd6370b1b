"""Models as scene files: the tables of the reader, written as TOML."""

import json
import re
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from shutil import copyfile
from typing import Any

from ephs.mechanics.scene.errors import Fault, SceneError, fault

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def convert(
    model: str | PathLike[str],
    scene: str | PathLike[str],
    base: str = "fixed",
    adjust: bool = False,
    inertia: str = "warn",
    *,
    contact: bool = False,
) -> None:
    """Write a model as a scene file, which loads to the same scene as the model.

    Parameters
    ----------
    model
        A URDF, an MJCF or an SDF.
    scene
        The scene file to write. Meshes beside or below it stay where they are; others are copied into a folder of
        theirs beside it, since scenes read nothing outside of their own.
    base, adjust, inertia, contact
        As `ephs.load` takes them; the scene file says them from then on.

    Warns
    -----
    SceneWarning, ModelWarning
        As `ephs.load`.

    Raises
    ------
    SceneError
        With every fault of the model.
    """
    from ephs.mechanics.imports.read import read_model
    from ephs.mechanics.scene.load import MODELS, load

    source, target = Path(model), Path(scene)
    if source.suffix not in MODELS:
        raise SceneError(str(model), [fault("model suffix", "", f'"{source.suffix}"')])
    if target.suffix != ".toml":
        raise SceneError(str(model), [fault("scene suffix", "scene", f'"{target.name}"')])
    load(source, base, adjust, inertia, contact=contact)  # faults and warnings are those of loading
    faults: list[Fault] = []
    tables = read_model(source, base, faults, [], contact=contact)
    if tables is None:
        raise SceneError(str(model), faults)
    tables["assembly"] = {"adjust": adjust, "inertia": inertia}
    _gather([shape for body in tables["bodies"].values() for shape in body.get("shapes", ())], source, target)
    target.write_text(toml_text(tables), encoding="utf-8")


def _gather(shapes: Iterable[dict[str, Any]], source: Path, target: Path) -> None:
    """Name meshes relative to the scene file; copy those from other folders."""
    home = target.parent.resolve()
    taken: dict[Path, Path] = {}
    for shape in shapes:
        if "mesh" not in shape:
            continue
        file: Path = (source.parent / shape["mesh"]).resolve()
        if not file.is_relative_to(home) and file not in taken:
            folder = home / f"{target.stem}-meshes"
            names = {path.name for path in taken.values()}
            name = file.name if file.name not in names else f"{len(taken)}-{file.name}"
            taken[file] = folder / name
            if taken[file].resolve() != taken[file]:
                raise SceneError(str(source), [fault("link", "meshes", f"a link at {taken[file].name} or its folder")])
            if file.is_file():
                folder.mkdir(exist_ok=True)
                copyfile(file, taken[file])
        place: Path = taken.get(file, file)
        shape["mesh"] = place.relative_to(home).as_posix()


def toml_text(tables: Mapping[str, Any]) -> str:
    """Nested tables as TOML; numbers are exact. Tables within a section's entries are written inline."""
    lines = [f"{key} = {_value(value)}" for key, value in tables.items() if not isinstance(value, Mapping)]
    for section, entries in tables.items():
        if not isinstance(entries, Mapping):
            continue
        if all(isinstance(entry, Mapping) for entry in entries.values()):
            for name, entry in entries.items():
                lines += ["", f"[{_key(section)}.{_key(name)}]", *_assignments(entry)]
        else:
            lines += ["", f"[{_key(section)}]", *_assignments(entries)]
    return "\n".join(lines) + "\n"


def _assignments(table: Mapping[str, Any]) -> Iterable[str]:
    for key, value in table.items():
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            yield f"{_key(key)} = ["
            yield from (f"    {_value(entry)}," for entry in value)
            yield "]"
        else:
            yield f"{_key(key)} = {_value(value)}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return _text(value) if isinstance(value, str) else repr(value)  # nan and inf are TOML's


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    # TOML's basic strings are JSON's, but for one control character that JSON may leave as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
