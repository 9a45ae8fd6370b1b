"""Problems of systems as text, for files of solutions and journals: system, prescribed efforts, surroundings."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.documents.systems import to_dict_in_order
from ephs.semantics.systems.system import System
from ephs.solve.posing.motion_law import HarmonicMotion, MotionLaw, PolynomialMotion, TabulatedMotion
from ephs.solve.posing.problem import Signal

_LAWS: dict[str, Any] = {law.__name__: law for law in (PolynomialMotion, HarmonicMotion, TabulatedMotion)}


def system_text(system: System, signals: Mapping[Path, Signal], reference: Reference) -> str:
    """The problem as JSON; empty where a component or a motion law cannot be written."""
    moved: dict[Path, Any] = {
        port: signal.value for port, signal in signals.items() if isinstance(signal.value, MotionLaw)
    }
    if any(type(law).__name__ not in _LAWS for law in moved.values()):
        return ""
    try:
        written = to_dict_in_order(system)
    except SemanticsError:
        return ""
    return json.dumps({
        "system": written,
        "efforts": [str(port) for port, signal in signals.items() if signal.effort],
        "laws": {str(port): {"law": type(law).__name__, **asdict(law)} for port, law in moved.items()},
        "reference": asdict(reference),
    })  # fmt: skip


def is_system_text(text: str) -> bool:
    """Whether it is the text of a system's problem; texts of scenes begin with other keys."""
    return text.startswith('{"system":')


def read_system_text(text: str) -> tuple[System, frozenset[str], dict[str, MotionLaw], Reference]:
    """System, ports whose effort is prescribed, motion laws among these, and surroundings; the text is read as data.

    Raises
    ------
    KeyError, TypeError, ValueError
        It is no such text.
    """
    found: dict[str, Any] = json.loads(text)
    laws = {port: _law(dict(given)) for port, given in found["laws"].items()}
    return System.from_dict(found["system"]), frozenset(found["efforts"]), laws, Reference(**found["reference"])


def _law(given: dict[str, Any]) -> MotionLaw:
    return _LAWS[given.pop("law")](
        **{key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
    )
