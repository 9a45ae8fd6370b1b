"""A mechanism in motion, as one HTML page that needs no network."""

import contextlib
import io
import math
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ephs.show.errors import ShowError
from ephs.show.motion import Array, Film, between, film, frame_all, point_of
from ephs.show.symbols import add_body, add_joint, add_spring, extent, ink

_GROUND = "ground"


def animate(
    sol: Any,
    path: str | FilePath | None = None,
    *,
    fps: float = 30.0,
    duration: float | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
) -> str:
    """Make a page that plays a solution of a scene, with play, pause, speed, time bar and free view.

    Bodies are drawn by their shape, or as the muted box of the same mass and inertia where they have none; each joint
    by the symbol of its kind, with its axis; springs as coils; the ground as a grid.

    Parameters
    ----------
    sol : Solution
        Of a scene.
    path : str or Path, optional
        Where to write the page.
    fps : float
        Frames a second of playing time.
    duration : float, optional
        Playing time in s; by default the model's own time.
    host, port : str, int
        Where the helper that records the page listens while it does; 0 takes any free port.

    Returns
    -------
    str
        The page.

    Raises
    ------
    ShowError
        If the solution has no scene, viser is not installed, or `fps` or `duration` is not positive.
    """
    if sol.scene is None:
        raise ShowError("scene", path=str(sol.name))
    for name, value in (("fps", fps), ("duration", duration)):
        if value is not None and not value > 0:
            raise ShowError("span", path=name, found=str(value), expected="something above 0")
    if find_spec("viser") is None:
        raise ShowError("viser")
    bodies = dict(sol.scene.all_bodies())
    frames = film(sol, list(bodies), fps, duration)
    page = _recorded(sol.scene, bodies, frames, host, port)
    page = page.replace("<title>Viser</title>", f"<title>{_plain(str(sol.name))}</title>", 1)
    if path is not None:
        FilePath(path).write_text(page, encoding="utf-8")
    return page


def _recorded(scene: Any, bodies: dict[str, Any], frames: Film, host: str, port: int) -> str:
    import viser

    joints = dict(scene.all_joints())
    springs = dict(scene.all_springs())
    reaches = {name: extent(body) for name, body in bodies.items()}
    places = _places(frames, joints, springs)
    size = _size(places, list(reaches.values()))
    # The helper writes a banner to the terminal whatever it is told.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, verbose=False)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            _stage(server, places, max([size / 20, *reaches.values()]), size)
            nodes = {}
            for index, (name, body) in enumerate(bodies.items()):
                pose = frames.poses[name][0]
                node = server.scene.add_frame(_node(name), show_axes=False, wxyz=pose[:4], position=pose[4:])
                add_body(server, f"{_node(name)}/shape", body, ink(index), size, name)
                nodes[name] = node
            for name, joint in joints.items():
                parent = "/ground" if joint.body1 == _GROUND else _node(joint.body1)
                add_joint(server, f"{parent}/joint {name}", joint, _symbol_size(joint, reaches, size))
            coils = {name: add_spring(server, f"/springs/{name}", size) for name in springs}
            recording = server.get_scene_serializer()
            for index in range(len(frames.times)):
                for name, node in nodes.items():
                    pose = frames.poses[name][index]
                    node.wxyz, node.position = pose[:4], pose[4:]
                for name, coil in coils.items():
                    start, end = _spring_ends(springs[name], frames, index)
                    turn, length = between(start, end)
                    coil.wxyz, coil.position, coil.scale = turn, start, (1.0, 1.0, max(length, 1e-9))
                # Only Python's own float will do here.
                recording.insert_sleep(float(frames.pause))
            return str(recording.as_html())
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def _node(name: str) -> str:
    return f"/bodies/{name.replace('/', '|')}"


def _plain(name: str) -> str:
    return name.replace("&", "&amp;").replace("<", "&lt;")


def _pose_of(name: str, frames: Film) -> Array:
    still = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return np.broadcast_to(still, (len(frames.times), 7)) if name == _GROUND else frames.poses[name]


def _spring_ends(spring: Any, frames: Film, index: int) -> tuple[Array, Array]:
    start = point_of(_pose_of(spring.body1, frames)[index], np.asarray(spring.at1, dtype=float))
    end = point_of(_pose_of(spring.body2, frames)[index], np.asarray(spring.at2, dtype=float))
    return start, end


def _places(frames: Film, joints: dict[str, Any], springs: dict[str, Any]) -> Array:
    """Every point (n, 3) that the camera must see: bodies, joints and spring ends, at all times."""
    found = [pose[:, 4:] for pose in frames.poses.values()]
    found += [point_of(_pose_of(j.body1, frames), np.asarray(j.frame1, dtype=float)[4:]) for j in joints.values()]
    for s in springs.values():
        found.append(point_of(_pose_of(s.body1, frames), np.asarray(s.at1, dtype=float)))
        found.append(point_of(_pose_of(s.body2, frames), np.asarray(s.at2, dtype=float)))
    return np.concatenate(found) if found else np.zeros((1, 3))


def _size(places: Array, reaches: list[float]) -> float:
    across = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
    size = max([across, *(2 * reach for reach in reaches)])
    return size if size > 0 else 1.0


def _symbol_size(joint: Any, reaches: dict[str, float], size: float) -> float:
    """A joint is drawn as large as befits the bodies that it joins."""
    near = [reaches[name] for name in (joint.body1, joint.body2) if reaches.get(name, 0.0) > 0]
    return float(np.clip(0.13 * min(near, default=0.25 * size), 0.012 * size, 0.05 * size))


def _stage(server: Any, places: Array, reach: float, size: float) -> None:
    """Ground, light and camera."""
    view = frame_all(places, reach)
    server.scene.set_up_direction("+z")
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = view.position, view.target, view.field
    camera.near, camera.far = 0.002 * size, 200.0 * size
    decade = 10.0 ** math.floor(math.log10(size / 2))
    cell = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= size / 2)
    side = cell * 2 * math.ceil(1.5 * size / cell)
    low = float(places[:, 2].min()) - 1.02 * reach
    middle = (round(view.target[0] / cell) * cell, round(view.target[1] / cell) * cell, low)
    server.scene.add_frame("/ground", show_axes=False)
    server.scene.add_grid(
        "/grid",
        width=side,
        height=side,
        position=middle,
        cell_size=cell / 5,
        section_size=cell,
        cell_color=(225, 228, 232),
        section_color=(196, 201, 208),
        fade_distance=8.0 * size,
        shadow_opacity=0.2,
    )
