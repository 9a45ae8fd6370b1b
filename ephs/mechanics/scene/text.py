"""Untrusted text file: regular, of moderate size, in UTF-8."""

from collections.abc import Sequence
from pathlib import Path

from ephs.mechanics.scene.errors import Fault, fault, nearest_name

MESHES = (".stl", ".obj", ".ply", ".glb", ".off")
"""Endings of files with a surface; of these, none unpacks an archive."""


READABLE = (".toml", ".urdf", ".xml", ".sdf")
"""Endings of files with a model."""


def nearest_file(file: Path, endings: Sequence[str] = READABLE) -> Path | None:
    """The file nearest to a misspelled path, of some endings, in its folder or in scenes/; None where none is near."""
    folders = [folder for folder in (file.parent, Path("scenes")) if folder.is_dir()]
    known = {path: path.name for folder in folders for path in sorted(folder.iterdir()) if path.suffix in endings}
    name = nearest_name(file.name, known.values()) or nearest_name(f"{file.stem}.toml", known.values())
    return next((path for path, found in known.items() if found == name), None)


def file_inside(file: Path, folder: Path) -> Path | None:
    """The resolved file, if it is in a folder or below it."""
    try:
        found = file.resolve()
        return found if found.is_relative_to(folder.resolve()) else None
    except (OSError, ValueError, RuntimeError):  # a name that no file can have, links that lead in a circle
        return None


def lost(file: Path) -> str:
    """Advice where a path leads to no file that can be read."""
    near = nearest_file(file, MESHES if file.suffix.lower() in MESHES else READABLE)
    return f'did you mean "{near}"?' if near else "check the path"


def file_text(path: Path, faults: list[Fault], key: str = "", most_mb: float = 10.0) -> str | None:
    """The text of a file, without a byte-order mark; None, with a fault at ``key``, where it has none.

    What is no regular file is not opened: a pipe or a device might never end.
    """
    try:
        if not path.exists():
            faults.append(fault("no file", key, "no file of this name", hint=lost(path)))
            return None
        if not path.is_file():
            faults.append(fault("not readable", key, "a folder" if path.is_dir() else "a pipe or a device"))
            return None
        size = path.stat().st_size / 1e6
        if size > most_mb:
            faults.append(fault("size", key, f"{size:.0f} MB", most=most_mb))
            return None
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        faults.append(fault("encoding", key, f"byte {error.start} that is none"))
    except OSError as error:
        faults.append(fault("not readable", key, error.strerror or "an error of the system"))
    except ValueError:  # a name with a zero byte
        faults.append(fault("no file", key, "a name that no file can have", hint="check the path"))
    return None
