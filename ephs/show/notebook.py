"""Pictures of values in notebooks: HTML with drawings as SVG, made without matplotlib."""

from html import escape
from typing import Any

import numpy as np

from ephs.mechanics.scene.model import Scene
from ephs.semantics.systems.markup import table
from ephs.show.motions.still import still_svg
from ephs.show.shared.palette import BLUE, GREY, INK, RED
from ephs.solve.result.tables import solution_table

WIDTH, HEIGHT, MARGIN, DOT = 260.0, 200.0, 24.0, 4.0
"""Size of the plane of eigenvalues, its margin, and the radius of a dot, in pixels."""
MANY = 40
"""Bodies above which no schematic is drawn, and rows above which a table ends."""


def solution_html(solution: Any) -> str:
    """Balances of a run beside the schematic of its first instant."""
    scene = solution.outline
    if scene is None or not len(solution):
        return solution_table(solution)
    poses = {name: first_pose(solution.body(name)) for name, _ in _few(scene)}
    return _beside(_schematic(scene, poses), solution_table(solution))


def dynamics_html(dynamics: Any) -> str:
    """Degrees of freedom and loops of a scene's dynamics beside its schematic."""
    scene = dynamics.scene
    rows = [
        ("degrees of freedom", str(dynamics.layout.n)),
        ("joints", ", ".join(dynamics.joints[:MANY])),
        *([("closed by constraints", ", ".join(dynamics.cut))] if dynamics.cut else []),
    ]
    poses = {name: np.asarray(body.pose, dtype=float) for name, body in _few(scene)}
    return _beside(_schematic(scene, poses), table(f"Dynamics of {scene.name}", (), rows))


def equilibrium_html(found: Any) -> str:
    """State of rest beside the schematic of a scene there."""
    rows = [("residual", f"{found.residual:.1e}"), ("steps", str(found.steps))]
    if found.critical:
        rows.append(("critical loads", ", ".join(f"{share:.4g}" for share in found.critical)))
    if not isinstance(found.model, Scene):
        rows += [(str(path), _numbers(value)) for path, value in list(found.states.items())[:MANY]]
        return table("Equilibrium", (), rows)
    scene = found.model
    moved = [(n, j) for n, j in scene.all_joints() if j.kind in ("revolute", "prismatic", "screw", "cylindrical")]
    rows += [(f"joints.{name}", _numbers(joint.coordinate)) for name, joint in moved[:MANY]]
    poses = {name: np.asarray(body.pose, dtype=float) for name, body in _few(scene)}
    return _beside(_schematic(scene, poses), table(f"Equilibrium of {scene.name}", (), rows))


def state_space_html(linear: Any) -> str:
    """Modes of a linear system beside its eigenvalues in the complex plane."""
    modes = linear.modes
    rows = [
        (
            ", ".join(name for name, _ in mode.largest(2)) or "–",
            f"{mode.eigenvalue:.4g}",
            f"{mode.frequency:.4g}",
            f"{mode.damping:.3g}",
        )
        for mode in modes[:MANY]
    ]
    size = f"{len(linear.states)} states, {len(linear.inputs)} inputs, {len(linear.outputs)} outputs"
    title = f"Linearised {linear.name}: {size}, {'stable' if linear.stable else 'not stable'}"
    return _beside(_plane(linear.eigenvalues), table(title, ("mode", "λ [1/s]", "f [Hz]", "damping ratio"), rows))


def _plane(values: Any) -> str:
    """Eigenvalues in the complex plane: growing ones in red."""
    if not len(values):
        return ""
    points = np.column_stack([np.real(values), np.imag(values)])
    low, high = np.minimum(points.min(axis=0), 0.0), np.maximum(points.max(axis=0), 0.0)
    room = np.array([WIDTH, HEIGHT]) - 2.0 * MARGIN
    span = np.where(high > low, high - low, 1.0)

    def point_of(point: Any) -> tuple[float, float]:
        x, y = MARGIN + room * (np.asarray(point) - low) / span
        return float(x), HEIGHT - float(y)

    zero = point_of((0.0, 0.0))
    lines = [
        f'<line x1="{MARGIN / 2}" x2="{WIDTH - MARGIN / 2}" y1="{zero[1]:.1f}" y2="{zero[1]:.1f}" stroke="{GREY}"/>',
        f'<line y1="{MARGIN / 2}" y2="{HEIGHT - MARGIN / 2}" x1="{zero[0]:.1f}" x2="{zero[0]:.1f}" stroke="{GREY}"/>',
    ]
    for value, point in zip(values, points, strict=True):
        x, y = point_of(point)
        colour = RED if value.real > 0.0 else BLUE
        said = escape(f"{complex(value):.5g} 1/s")
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{DOT}" fill="{colour}"><title>{said}</title></circle>')
    style = f'font-family="system-ui,sans-serif" font-size="11" fill="{INK}"'
    words = f'<text x="{WIDTH - MARGIN}" y="{min(zero[1] + 14, HEIGHT - 2):.1f}" {style}>Re</text>'
    words += f'<text x="{zero[0] + 5:.1f}" y="12" {style}>Im</text>'
    size = f'viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" width="{WIDTH:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(lines)}{words}</svg>'


def _few(scene: Any) -> list[tuple[str, Any]]:
    """Bodies of a scene small enough for drawing; empty for a larger one."""
    bodies = list(scene.all_bodies())
    return bodies if len(bodies) <= MANY else []


def _schematic(scene: Any, poses: dict[str, Any]) -> str:
    return still_svg(scene, poses) if poses else ""


def first_pose(body: Any) -> Any:
    """(7,) at the first instant."""
    return np.concatenate([np.asarray(body.quaternion)[0], np.asarray(body.position)[0]])


def _numbers(value: Any) -> str:
    return ", ".join(f"{x:.5g}" for x in np.atleast_1d(np.asarray(value, dtype=float)))


def _beside(picture: str, words: str) -> str:
    if not picture:
        return words
    held = f'<div style="flex:0 1 26rem">{picture}</div><div>{words}</div>'
    return f'<div style="display:flex;flex-wrap:wrap;gap:1rem;align-items:center">{held}</div>'
