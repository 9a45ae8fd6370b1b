"""Object code in the package: a folder for each kind of processor, a linkable file for each program.

An index names each file by the digest of the module's text, and gives the digest of its content. What is not in the
index, or does not agree with it, counts as absent: then the module is compiled.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, cast

FOLDER: Final = Path(__file__).resolve().parents[2] / "objects"
"""Folder of the package's object code, built with a wheel; it may be absent."""
INDEX: Final = "index.json"


def shipped(text: str, targets: Iterable[str], folder: Path = FOLDER) -> bytes | None:
    """Return a module's object code for the first available of some targets, or None.

    Parameters
    ----------
    text
        Assembly text of LLVM.
    targets
        Names of targets, the best first.
    folder
        Where the files lie.
    """
    files = _index(folder).get(_digest(text.encode()))
    for target in targets if isinstance(files, dict) else ():
        match cast("dict[str, object]", files).get(target):
            case [str(name), str(digest)]:
                content = _read(folder / name)
                if content is not None and _digest(content) == digest:
                    return content
            case _:
                continue
    return None


def ship(modules: Mapping[str, tuple[str, Mapping[str, bytes]]], headers: Mapping[str, str], folder: Path) -> None:
    """Write object code, headers and the index.

    Parameters
    ----------
    modules
        Of each program, by name, its text and its object code by target.
    headers
        C headers by the program's name.
    folder
        Where to; it is made.
    """
    index: dict[str, dict[str, list[str]]] = {}
    for program, (text, codes) in modules.items():
        files = index.setdefault(_digest(text.encode()), {})
        for target, code in codes.items():
            name = f"{target}/{program}.o"
            (folder / target).mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(code)
            files[target] = [name, _digest(code)]
    for program, header in headers.items():
        (folder / f"{program}.h").write_text(header, encoding="utf-8")
    (folder / INDEX).write_text(json.dumps(index, indent=1, sort_keys=True) + "\n", encoding="utf-8")


@cache
def _index(folder: Path) -> dict[str, Any]:
    """Return the index of a folder, read once; empty if absent or corrupt."""
    try:
        found: object = json.loads(_read(folder / INDEX) or b"{}")
    except ValueError:
        return {}
    return cast("dict[str, Any]", found) if isinstance(found, dict) else {}


def _read(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
