"""Conversion of a model file to tables of a scene file, by its first element."""

from pathlib import Path
from typing import Any

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.imports.sdf import read_sdf
from ephs.mechanics.imports.urdf import read_urdf
from ephs.mechanics.imports.xml import read_tree
from ephs.mechanics.scene.errors import Fault, fault

KINDS = ("robot", "mujoco", "sdf")


def read_model(
    path: Path, base: str, faults: list[Fault], left: list[str], *, contact: bool = False
) -> dict[str, Any] | None:
    """The tables of a model; None where there were faults.

    Parameters
    ----------
    path
        A URDF, an MJCF or an SDF; which of them, its first element says.
    base
        ``"fixed"`` or ``"free"``: how the root of a URDF meets the ground.
    contact
        Whether limits of joints and contacts are read.
    left
        Takes a line for each kind of what the tables leave out.
    """
    root = read_tree(path, faults)
    if root is None:
        return None
    if root.tag not in KINDS:
        known = ", ".join(f"<{kind}>" for kind in KINDS)
        faults.append(fault("root element", "", f"<{root.tag}>", known=known))
        return None
    count = len(faults)
    draft = Draft(path.stem, path.parent, faults, contact=contact)
    match root.tag:
        case "robot" | "sdf":
            node = FileElement(root)
            if root.tag == "sdf":
                read_sdf(node, draft)
            else:
                read_urdf(node, draft, base)
            node.leave_unread(draft)
        case _:
            from ephs.mechanics.imports.mjcf import read_mjcf

            read_mjcf(root, draft)
    left += draft.left()
    return draft.document() if len(faults) == count else None
