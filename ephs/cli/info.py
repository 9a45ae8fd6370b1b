"""`ephs info`: contents of a model on one screen."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ephs.cli.input import AS_GIVEN, LoadOptions, addressed, load_model, say

if TYPE_CHECKING:
    from ephs import Scene, System

MOST = 12
"""Rows of a table; a line counts the others."""

DIGITS = 12
"""Decimals of positions in m."""


def info(scene: str, /, *, loading: LoadOptions = AS_GIVEN) -> int:
    """List bodies, joints, degrees of freedom, inputs and outputs of a model.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    """
    import ephs

    model = load_model(scene, loading)
    with addressed(scene):
        lines = _of_scene(model) if isinstance(model, ephs.Scene) else _of_system(model, scene)
    say(*lines)
    return 0


def _of_scene(scene: "Scene") -> list[str]:
    from ephs.mechanics.motion.readout import freedoms_of
    from ephs.mechanics.runs.scene_problem import problem_of_scene
    from ephs.mechanics.scene.build import element_inputs
    from ephs.mechanics.scene.own_units import mobility_of

    bodies, joints = list(scene.all_bodies()), list(scene.all_joints())
    found = mobility_of(problem_of_scene(scene))
    freedoms = {name: freedoms_of(joint) for name, joint in joints}
    mass = sum(body.mass for _, body in bodies)
    lines = [
        f"{scene.name}: bodies {len(bodies)}, {mass:g} kg; joints {len(joints)}; degrees of freedom {found.mobility}; "
        f"redundant constraints {found.redundant}",
        *_table(("body", "mass [kg]", "position [m]"), ((n, f"{b.mass:g}", _row(b.pose[4:])) for n, b in bodies)),
        *_table(
            ("joint", "type", "between", "degrees of freedom"),
            ((n, j.kind, f"{j.body1} – {j.body2}", _coordinates(freedoms[n]) if j.dim else "none") for n, j in joints),
        ),
    ]
    own = dict.fromkeys(section for section, _, _ in scene.all_elements())
    rest: dict[str, Iterable[str]] = {
        "springs": (name for name, _ in scene.all_springs()),
        "shells": (name for name, _ in scene.all_shells()),
        "tendons": (name for name, _ in scene.all_tendons()),
        "beams": (name for name, _ in scene.all_beams()),
        "contacts": (name for name, _ in scene.all_contacts()),
        "thermal nodes": (name for name, _ in scene.all_thermal()),
        **{section: (name for name, _ in scene.every(section)) for section in own},
        "prescribed motions": (name for name, j in joints if j.motion is not None),
    }
    lines += [f"{kind}: {', '.join(_few(names))}" for kind, given in rest.items() if (names := list(given))]
    markers = [f"markers.{name}" for name, _ in scene.all_markers()]
    inputs = [f"joints.{name}" for name, j in joints if j.dim and j.motion is None]
    inputs += [*element_inputs(scene), *(f"actuators.{name}" for name, _ in scene.every("actuators"))]
    return [
        *lines,
        f"inputs: {', '.join(_few([*inputs, *markers]))}, bodies.NAME",
        "outputs: joints.NAME.{coordinate, rate, wrench}, bodies.NAME.{position, velocity, …}, "
        + ("thermal.NAME.temperature, " if any(True for _ in scene.all_thermal()) else "")
        + "energy, heat, work, …; ephs plot RUN lists all",
    ]


def _of_system(system: "System", name: str) -> list[str]:
    from ephs.solve.result.labels import labels_of

    descriptor = system.descriptor()
    states = ((str(slot.path), slot.quantity.kind, labels_of(slot.quantity)) for slot in descriptor.states)
    ports = ((str(path), port.quantity.kind) for path, port in system.interface.items() if port.power)
    return [
        f"{name}: {len(descriptor.system.flatten().pattern.boxes)} components, {len(descriptor.states)} states",
        *_table(
            ("state", "quantity", "unit"),
            ((path, kind, ", ".join(dict.fromkeys(labels.units))) for path, kind, labels in states),
        ),
        *_table(("outer port", "quantity"), ports),
        "outputs: the states, energy, heat, work, …",
    ]


def _coordinates(labels: Any) -> str:
    return ", ".join(
        f"{name or 'coordinate'} [{unit}]" for name, unit in zip(labels.names or ("",), labels.units, strict=True)
    )


def _row(values: Any) -> str:
    return ", ".join(f"{round(value, DIGITS) + 0.0:.4g}" for value in values)


def _few(names: list[str]) -> list[str]:
    return names if len(names) <= MOST else [*names[:MOST], f"and {len(names) - MOST} more"]


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Rows under a heading in columns; nothing without rows."""
    cells = list(rows)
    if not cells:
        return []
    shown = [head, *cells[:MOST]]
    widths = [max(len(row[k]) for row in shown) for k in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in shown]
    return [*lines, f"and {len(cells) - MOST} more"] if len(cells) > MOST else lines
