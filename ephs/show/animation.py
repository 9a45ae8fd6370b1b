"""A mechanism in motion, as one HTML page that needs no network."""

import contextlib
import html
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Any, final

import numpy as np

from ephs.show.errors import ShowError
from ephs.show.motion import Array, Film, best_side, between, film, frame_all, point_of
from ephs.show.overlays import ARROWS, GROUND, Heat, Loads, heat_of, loads_of, tint
from ephs.show.page import Page
from ephs.show.solids import Solid, held_at, solids_of
from ephs.show.symbols import METAL, Colour, add_body, add_joint, add_spring, add_stick, ink

__all__ = ["animate"]

LONGEST = 0.35
"""Length of the longest arrow, in parts of the scene's size."""
THROUGH = 0.6
"""Opacity of bodies with arrows inside."""


def animate(
    sol: Any,
    path: str | FilePath | None = None,
    *,
    wrenches: bool = False,
    heat: bool = False,
    fps: float = 30.0,
    duration: float | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
) -> Page:
    """Make a page that plays a solution of a scene, with play, pause, speed, time bar and free view.

    Bodies are drawn by their shape or mesh, or as the muted box of the same mass and inertia where they have none;
    each joint by the symbol of its kind, with its axis; springs as coils; the ground as a grid.

    Parameters
    ----------
    sol : Solution
        Of a scene.
    path : str or Path, optional
        Where to write the page.
    wrenches : bool
        Whether joint forces and moments on body 2 are drawn as arrows; none where a joint leaves them indeterminate.
    heat : bool
        Whether joints and springs glow by the temperature of the thermal node that takes their heat, and bodies by the
        node of their name.
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
        If the solution has no scene, or no instants, viser is not installed, or `fps` or `duration` is not positive.
    """
    if sol.scene is None:
        raise ShowError("scene", path=str(sol.name))
    if not len(sol.t):
        raise ShowError("nothing", path=str(sol.name), found="instants", expected="some to show")
    for name, value in (("fps", fps), ("duration", duration)):
        if value is not None and not value > 0:
            raise ShowError("span", path=name, found=str(value), expected="something above 0")
    if find_spec("viser") is None:
        raise ShowError("viser")
    bodies = dict(sol.scene.all_bodies())
    frames = film(sol, list(bodies), fps, duration)
    solids = solids_of(sol.scene)
    stage = _Stage(
        dict(sol.scene.all_joints()),
        dict(sol.scene.all_springs()),
        bodies,
        solids,
        frames,
        loads_of(sol, frames, dict(sol.scene.all_joints())) if wrenches else None,
        heat_of(sol, frames, [name for name, _ in sol.scene.all_thermal()]) if heat else None,
    )
    text = stage.recorded(host, port)
    text = text.replace("<title>Viser</title>", f"<title>{html.escape(str(sol.name))}</title>", 1)
    text = f"{stage.legend()}</body>".join(text.rsplit("</body>", 1))
    page = Page(text, str(sol.name))
    if path is not None:
        page.save(path)
    return page


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Stage:
    """Film that is played."""

    joints: dict[str, Any]
    springs: dict[str, Any]
    bodies: dict[str, Any]
    solids: dict[str, Solid]
    frames: Film
    loads: Loads | None
    heat: Heat | None

    def recorded(self, host: str, port: int) -> str:
        """The page as viser makes it."""
        import viser

        with _silence():
            server = viser.ViserServer(host=host, port=port, verbose=False)
            try:
                return self._played(server)
            finally:
                server.stop()

    def _played(self, server: Any) -> str:
        places, reaches = self._places()
        size = _size(places, reaches)
        tips = [self._tips(kind, frame, size) for kind in self._kinds() for frame in range(len(self.frames.times))]
        seen = np.concatenate([places, *(tip[:, 1] for tip in tips)])
        _set(server, seen, np.concatenate([reaches, np.zeros(len(seen) - len(places))]), size, best_side(places))
        nodes: dict[str, Any] = {}
        warm: list[_Warm] = []
        for index, name in enumerate(self.bodies):
            pose = self.frames.poses[name][0]
            nodes[name] = server.scene.add_frame(_node(name), show_axes=False, wxyz=pose[:4], position=pose[4:])
            solid, opacity = self.solids[name], None if self.loads is None else THROUGH
            drawn = add_body(server, f"{_node(name)}/shape", solid, ink(index), size, opacity)
            warm += [_Warm(name, part, "color", part.color) for part in drawn]
            for k, point in enumerate(held_at(name, self.joints.values(), self.springs.values())):
                if stick := solid.stick(point):
                    add_stick(server, f"{_node(name)}/stick {k}", stick, drawn[0].color, 0.008 * size)
        for name, joint in self.joints.items():
            parent = "/ground" if joint.body1 == GROUND else _node(joint.body1)
            metal = add_joint(server, f"{parent}/joint {name}", joint, self._symbol_size(joint, size))
            warm += [_Warm(joint.heat, drawn, "color", METAL) for drawn in metal] if self.heat else []
        coils = {name: add_spring(server, f"/springs/{name}", size) for name in self.springs}
        warm += [_Warm(self.springs[name].heat, coil, "colors", METAL) for name, coil in coils.items() if self.heat]
        arrows = self._arrows(server, size)
        recording = server.get_scene_serializer()
        for frame in range(len(self.frames.times)):
            for name, node in nodes.items():
                pose = self.frames.poses[name][frame]
                node.wxyz, node.position = pose[:4], pose[4:]
            for name, coil in coils.items():
                start, end = self._spring_ends(self.springs[name], frame)
                turn, length = between(start, end)
                coil.wxyz, coil.position, coil.scale = turn, start, (1.0, 1.0, max(length, 1e-9))
            for kind, node in arrows.items():
                node.points = self._tips(kind, frame, size)
            for each in warm:
                if self.heat is not None:
                    each.glow(self.heat, frame)
            # Only Python's own float will do here.
            recording.insert_sleep(float(self.frames.pause))
        return str(recording.as_html())

    def legend(self) -> str:
        """Legend of arrows and colours, and missing meshes, in a corner of the page."""
        rows: list[str] = []
        if self.loads is not None:
            for kind, unit in (("force", "N"), ("moment", "N m")):
                if self.loads.largest[kind] > 0.0:
                    colour = "rgb({},{},{})".format(*ARROWS[kind])
                    most = f"{self.loads.largest[kind]:.3g} {unit}"
                    arrow = f'<b style="color:{colour};font-size:1.4em;line-height:1">→</b>'
                    rows.append(f"{arrow} {kind} on body 2, the longest {most}")
            if self.loads.loose:
                rows.append(f"indeterminate, so in part not drawn: {html.escape(', '.join(self.loads.loose))}")
        if self.heat is not None and self.heat.high > self.heat.low:
            stops = ",".join("rgb({},{},{})".format(*tint(k / 8)) for k in range(9))
            bar = f"display:inline-block;width:7em;height:.7em;background:linear-gradient(90deg,{stops})"
            rows.append(f'{self.heat.low:.2f} K <span style="{bar}"></span> {self.heat.high:.2f} K')
        elif self.heat is not None:
            rows.append(f"everything at {self.heat.low:.2f} K")
        rows += [html.escape(solid.note) for solid in self.solids.values() if solid.note]
        if not rows:
            return ""
        style = (
            "position:fixed;left:.8rem;bottom:4.2rem;z-index:9;padding:.4rem .7rem;border-radius:6px;"
            "background:rgba(255,255,255,.85);font:13px/1.6 system-ui,sans-serif;color:#1a1a1a;pointer-events:none"
        )
        return f'<div id="legend" style="{style}">{"<br>".join(rows)}</div>'

    def _arrows(self, server: Any, size: float) -> dict[str, Any]:
        return {
            kind: server.scene.add_arrows(
                f"/{kind}s",
                points=self._tips(kind, 0, size),
                colors=ARROWS[kind],
                shaft_radius=0.006 * size,
                head_radius=0.015 * size,
                head_length=0.035 * size,
            )
            for kind in self._kinds()
        }

    def _kinds(self) -> list[str]:
        """The kinds of arrows that there are."""
        return [] if self.loads is None else [kind for kind, most in self.loads.largest.items() if most > 0.0]

    def _tips(self, kind: str, frame: int, size: float) -> Any:
        """(n, 2, 3) start and end of each joint's arrow of this kind."""
        loads = self.loads
        assert loads is not None
        vectors = (loads.force if kind == "force" else loads.moment)[frame]
        start = loads.places[frame]
        return np.stack([start, start + LONGEST * size / loads.largest[kind] * vectors], axis=1).astype(np.float32)

    def _pose_of(self, name: str) -> Array:
        still = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        return np.broadcast_to(still, (len(self.frames.times), 7)) if name == GROUND else self.frames.poses[name]

    def _spring_ends(self, spring: Any, frame: int) -> tuple[Array, Array]:
        start = point_of(self._pose_of(spring.body1)[frame], np.asarray(spring.at1, dtype=float))
        end = point_of(self._pose_of(spring.body2)[frame], np.asarray(spring.at2, dtype=float))
        return start, end

    def _places(self) -> tuple[Array, Array]:
        """Every point (n, 3) that the camera must see at any time, and how far about each."""
        found = [(self.frames.poses[name][:, 4:], solid.reach) for name, solid in self.solids.items()]
        ends = [(j.body1, np.asarray(j.frame1, dtype=float)[4:]) for j in self.joints.values()]
        ends += [(s.body1, np.asarray(s.at1, dtype=float)) for s in self.springs.values()]
        ends += [(s.body2, np.asarray(s.at2, dtype=float)) for s in self.springs.values()]
        found += [(point_of(self._pose_of(body), at), 0.0) for body, at in ends]
        points = np.concatenate([points for points, _ in found]) if found else np.zeros((1, 3))
        reaches = np.concatenate([np.full(len(points), reach) for points, reach in found]) if found else np.zeros(1)
        return points, reaches

    def _symbol_size(self, joint: Any, size: float) -> float:
        """A joint is drawn as large as befits the bodies that it joins."""
        near = [self.solids[name].reach for name in (joint.body1, joint.body2) if name in self.solids]
        small = min([reach for reach in near if reach > 0.0], default=0.25 * size)
        return float(np.clip(0.16 * small, 0.014 * size, 0.05 * size))


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Warm:
    """Appearance of a thermal node: the property that is its colour, and that colour when cold."""

    node: str
    drawn: Any
    name: str
    cold: Colour

    def glow(self, heat: Heat, frame: int) -> None:
        """Colour it; what did not change is not said again, which keeps the page small."""
        share, before = heat.share(self.node, frame), heat.share(self.node, max(0, frame - 1))
        if self.node in heat.temperatures and (frame == 0 or self._colour(share) != self._colour(before)):
            setattr(self.drawn, self.name, self._colour(share))

    def _colour(self, share: float) -> Colour:
        # below a tenth the own colour fades into that of warm metal
        fade = min(1.0, 10.0 * share)
        red, green, blue = (round((1.0 - fade) * a + fade * b) for a, b in zip(self.cold, tint(share), strict=True))
        return red, green, blue


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """The helper writes a banner whatever it is told: to the terminal, and in notebooks through rich."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        console.quiet = before


def _node(name: str) -> str:
    return f"/bodies/{name.replace('/', '|')}"


def _size(places: Array, reaches: Array) -> float:
    across = float(np.linalg.norm((places + reaches[:, None]).max(axis=0) - (places - reaches[:, None]).min(axis=0)))
    return across if across > 0 else 1.0


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
