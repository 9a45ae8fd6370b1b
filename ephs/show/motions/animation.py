"""A mechanism in motion, as one HTML page that needs no network."""

import contextlib
import html
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Any, final

import numpy as np

from ephs.show.motions.motion import Array, best_side, between, frame_all, point_of
from ephs.show.motions.overlays import GROUND, Arrows, Shades, Tones, tint
from ephs.show.motions.player import player
from ephs.show.motions.solids import held_at
from ephs.show.motions.stage import Stage, stage_of
from ephs.show.motions.symbols import METAL, Colour, add_body, add_joint, add_spring, add_stick, ink
from ephs.show.shared.errors import ShowError
from ephs.show.shared.page import Page

LONGEST = 0.35
"""Length of the longest arrow, in parts of the scene's size."""
FAR = 4.0
"""Way in parts of the mechanism's size beyond which the camera frames the start only."""
COIL = 1e-9
"""Least length of the coil of a spring in m: none is turned inside out."""
THROUGH = 0.6
"""Opacity of bodies with arrows inside."""


def animate(
    sol: Any,
    path: str | FilePath | None = None,
    *,
    wrenches: bool = False,
    colour: str | None = None,
    fps: float = 30.0,
    duration: float | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
) -> Page:
    """Page with the animation of a scene's solution: play, pause, speed, time bar and free view.

    Bodies are drawn by their shape or mesh, or as the muted box of the same mass and inertia where they have none;
    each joint by the symbol of its kind, with its axis; springs as coils; the ground as a grid.

    Parameters
    ----------
    sol : Solution
        Of a scene, or of a system with bodies.
    path : str or Path, optional
        Where to write the page.
    wrenches : bool
        Whether joint forces and moments on body 2, and contact forces on the second body, are drawn as arrows; none
        where a joint leaves them indeterminate.
    colour : str, optional
        What is shown by colour: ``"temperature"``, of the thermal node that takes the heat of a joint, spring or shell,
        or that has a body's name; ``"energy"``, strain energy of beams per length and of shells per area;
        ``"membrane"``, ``"moment"`` or ``"shear"``, the size of that force or moment of shells of scenes.
    fps : float
        Frames a second of playing time.
    duration : float, optional
        Playing time in s; by default the model's own time.
    host, port : str, int
        Where the helper that records the page listens while it does; 0 takes any free port.

    Returns
    -------
    Page
        It shows itself in notebooks; ``.html`` is its text.

    Raises
    ------
    ShowError
        If the solution has no bodies, no instants or nothing of the colour, viser is not installed, or `fps` or
        `duration` is not positive.
    """
    stage = stage_of(sol, wrenches=wrenches, colour=colour, fps=fps, duration=duration)
    if find_spec("viser") is None:
        raise ShowError("viser")
    drawn = _Drawn(stage)
    text = drawn.recorded(host, port)
    text = text.replace("<title>Viser</title>", f"<title>{html.escape(str(sol.name))}</title>", 1)
    text = f"{drawn.legend()}{_flat(stage, str(sol.name))}</body>".join(text.rsplit("</body>", 1))
    page = Page(text, str(sol.name))
    if path is not None:
        page.save(path)
    return page


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """A stage drawn by viser."""

    stage: Stage

    def recorded(self, host: str, port: int) -> str:
        """The page made by viser."""
        import viser

        with _silence():
            server = viser.ViserServer(host=host, port=port, verbose=False)
            try:
                return self._played(server)
            finally:
                server.stop()

    def _played(self, server: Any) -> str:
        points, radii = self.stage.places()
        size = self.stage.size()
        across = float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))
        some = points if across < FAR * size else points[:1]  # of long ways the start is framed
        places, reaches = some.reshape(-1, 3), np.tile(radii, len(some))
        shown = () if self.stage.loads is None else self.stage.loads.arrows
        tips = [each.tips(LONGEST * size)[: len(some)].reshape(-1, 3) for each in shown]
        seen = np.concatenate([places, *tips])
        side = best_side(points.reshape(-1, 3))
        _set(server, seen, np.concatenate([reaches, np.zeros(len(seen) - len(places))]), size, side)
        nodes: dict[str, Any] = {}
        warm: list[_Warm] = []
        for index, name in enumerate(self.stage.solids):
            pose = self.stage.frames.poses[name][0]
            nodes[name] = server.scene.add_frame(_node(name), show_axes=False, wxyz=pose[:4], position=pose[4:])
            solid, opacity = self.stage.solids[name], None if self.stage.loads is None else THROUGH
            drawn = add_body(server, f"{_node(name)}/shape", solid, ink(index), size, opacity)
            warm += [_Warm(name, part, "color", part.color) for part in drawn]
            for k, point in enumerate(held_at(name, self.stage.joints.values(), self.stage.springs.values())):
                if stick := solid.stick(point):
                    add_stick(server, f"{_node(name)}/stick {k}", stick, drawn[0].color, 0.008 * size)
        for name, joint in self.stage.joints.items():
            parent = "/ground" if joint.body1 == GROUND else _node(joint.body1)
            metal = add_joint(server, f"{parent}/joint {name}", joint, self.stage.symbol_size(joint, size))
            warm += [_Warm(joint.heat, drawn, "color", METAL) for drawn in metal]
        coils = {
            name: add_spring(server, f"/springs/{name}", size * spring.coiled)
            for name, spring in self.stage.springs.items()
        }
        warm += [_Warm(self.stage.springs[name].heat, coil, "colors", METAL) for name, coil in coils.items()]
        sheets = self._sheets(server)
        arrows = self._arrows(server, size, shown)
        recording = server.get_scene_serializer()
        for frame in range(len(self.stage.frames.times)):
            for name, node in nodes.items():
                pose = self.stage.frames.poses[name][frame]
                node.wxyz, node.position = pose[:4], pose[4:]
            for name, coil in coils.items():
                start, end = self._spring_ends(self.stage.springs[name], frame)
                turn, length = between(start, end)
                coil.wxyz, coil.position, coil.scale = turn, start, (1.0, 1.0, max(length, COIL))
            for node, points in arrows:
                node.points = points[frame]
            for each in warm:
                each.glow(self.stage.shades, frame)
            for sheet in sheets:
                sheet.bend(self.stage.shades, frame)
            # Only Python's own float will do here.
            recording.insert_sleep(float(self.stage.frames.pause))
        return str(recording.as_html())

    def legend(self) -> str:
        """Legend of arrows and colours, and missing meshes, in a corner of the page."""
        rows: list[str] = []
        if self.stage.loads is not None:
            for each in self.stage.loads.arrows:
                colour = "rgb({},{},{})".format(*each.colour)
                arrow = f'<b style="color:{colour};font-size:1.4em;line-height:1">→</b>'
                rows.append(f"{arrow} {each.label}")
            if self.stage.loads.loose:
                rows.append(f"indeterminate, so in part not drawn: {html.escape(', '.join(self.stage.loads.loose))}")
        for each in self.stage.shades:
            stops = ",".join("rgb({},{},{})".format(*tint(k / 8)) for k in range(9))
            bar = f"display:inline-block;width:7em;height:.7em;background:linear-gradient(90deg,{stops})"
            low, high = each.ends
            rows.append(f'{each.said} {low} <span style="{bar}"></span> {high}')
        rows += [html.escape(solid.note) for solid in self.stage.solids.values() if solid.note]
        if not rows:
            return ""
        style = (
            "position:fixed;left:.8rem;bottom:4.2rem;z-index:9;padding:.4rem .7rem;border-radius:6px;"
            "background:rgba(255,255,255,.85);font:13px/1.6 system-ui,sans-serif;color:#1a1a1a;pointer-events:none"
        )
        return f'<div id="legend" style="{style}">{"<br>".join(rows)}</div>'

    def _sheets(self, server: Any) -> "list[_Bent]":
        """A mesh for each shell, or one for each element where these have colours of their own."""
        found: list[_Bent] = []
        for index, (name, sheet) in enumerate(self.stage.sheets.items()):
            places = sheet.places(self.stage.frames.poses)
            several = any(name in each.faces for each in self.stage.shades)
            parts = [cell[None] for cell in sheet.cells] if several else [sheet.cells]
            own = ink(len(self.stage.solids) + index)
            for k, cells in enumerate(parts):
                used, where = np.unique(cells, return_inverse=True)
                corners = where.reshape(cells.shape)
                mesh = server.scene.add_mesh_simple(
                    f"/shells/{name.replace('/', '|')}/{k}",
                    vertices=places[0, used].astype(np.float32),
                    faces=np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]),
                    color=own,
                    side="double",
                    flat_shading=several,
                )
                found.append(_Bent(name, k if several else None, mesh, places[:, used]))
        return found

    @staticmethod
    def _arrows(server: Any, size: float, shown: Sequence[Arrows]) -> list[tuple[Any, Any]]:
        """Nodes of each kind, and (m, n, 2, 3) where their arrows begin and end at each frame."""
        ends: list[Any] = [
            np.stack([each.places, each.tips(LONGEST * size)], axis=2).astype(np.float32) for each in shown
        ]
        nodes = [
            server.scene.add_arrows(
                f"/{each.kind}s",
                points=points[0],
                colors=each.colour,
                shaft_radius=0.006 * size,
                head_radius=0.015 * size,
                head_length=0.035 * size,
            )
            for each, points in zip(shown, ends, strict=True)
        ]
        return list(zip(nodes, ends, strict=True))

    def _spring_ends(self, spring: Any, frame: int) -> tuple[Array, Array]:
        start = point_of(self.stage.pose_of(spring.body1)[frame], np.asarray(spring.at1, dtype=float))
        end = point_of(self.stage.pose_of(spring.body2)[frame], np.asarray(spring.at2, dtype=float))
        return start, end


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Warm:
    """Appearance of a thermal node: the property that is its colour, and that colour when cold."""

    node: str
    drawn: Any
    name: str
    cold: Colour

    def glow(self, shades: tuple[Shades, ...], frame: int) -> None:
        """Colour it; unchanged colours are not repeated, which keeps the page small."""
        now, before = (Tones(shades, k).of(self.node, self.cold) for k in (frame, max(0, frame - 1)))
        if now != before or (frame == 0 and now != self.cold):
            setattr(self.drawn, self.name, now)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Bent:
    """A mesh of a shell, or of one of its elements with its colour; places (n, m, 3) of its corners at n frames."""

    shell: str
    element: int | None
    drawn: Any
    places: Array

    def bend(self, shades: tuple[Shades, ...], frame: int) -> None:
        """Move its corners, and colour it."""
        self.drawn.vertices = self.places[frame].astype(np.float32)
        now, before = (Tones(shades, k).faces(self.shell) for k in (frame, max(0, frame - 1)))
        if now and before and self.element is not None and (frame == 0 or now[self.element] != before[self.element]):
            self.drawn.color = now[self.element]


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Silence the banner that the server writes to the terminal and, through rich, in notebooks."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        console.quiet = before


def _flat(stage: Stage, title: str) -> str:
    """The player on a canvas, shown in place of the page where the browser has no WebGL."""
    return (
        '<div id="flat" hidden style="position:fixed;inset:0;z-index:99;background:#fff">'
        f"<template>{player(stage, title, '100vh')}</template></div><script>"
        'if(!document.createElement("canvas").getContext("webgl2")){const flat=document.getElementById("flat");'
        'flat.hidden=false;for(const id of ["root","legend"])document.getElementById(id)?.setAttribute("hidden","");'
        "flat.append(flat.firstElementChild.content);"
        'for(const old of flat.querySelectorAll("script:not([type])")){const made=document.createElement("script");'
        "made.textContent=old.textContent;old.replaceWith(made)}}</script>"
    )


def _node(name: str) -> str:
    return f"/bodies/{name.replace('/', '|')}"


def _set(server: Any, places: Array, reaches: Array, size: float, side: Array) -> None:
    """Ground, light and camera."""
    view = frame_all(places, np.maximum(reaches, size / 25), side)
    server.scene.set_up_direction("+z")
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = view.position, view.target, view.field
    camera.near, camera.far = 0.002 * size, 200.0 * size
    decade = 10.0 ** math.floor(math.log10(size / 2))
    cell = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= size / 2)
    width = cell * 2 * math.ceil(1.5 * size / cell)
    low = float((places[:, 2] - reaches).min()) - 0.02 * size
    middle = (round(view.target[0] / cell) * cell, round(view.target[1] / cell) * cell, low)
    server.scene.add_frame("/ground", show_axes=False)
    server.scene.add_grid(
        "/grid",
        width=width,
        height=width,
        position=middle,
        cell_size=cell / 5,
        section_size=cell,
        cell_color=(225, 228, 232),
        section_color=(196, 201, 208),
        fade_distance=8.0 * size,
        shadow_opacity=0.2,
    )
