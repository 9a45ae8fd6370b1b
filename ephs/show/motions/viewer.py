"""A page with a mechanism: sliders for its joints, and model files dropped on it, by a local server."""

import html
import json
import tempfile
import warnings
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path as FilePath
from threading import Lock
from typing import Any, Final, final
from urllib.parse import parse_qs, urlsplit

import numpy as np

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.errors import SceneError
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import Joint, Scene
from ephs.semantics.bundles.bundle import Array
from ephs.show.motions.player import player
from ephs.show.motions.stage import Stage, stage_of
from ephs.show.shared.page import Page, asset
from ephs.solve.result.record import RunRecord
from ephs.solve.running.ending import solution_of

LARGEST: Final = 64 * 2**20
"""Largest size of a dropped model, in bytes."""
Load = Callable[[FilePath], Scene]


@final
class Posed:
    """A scene in the sliders' configuration; loops stay closed.

    Parameters
    ----------
    scene
        As it stands.
    load
        Reads a model's file.

    Attributes
    ----------
    notes
        What reading the last one said.
    """

    def __init__(self, scene: Scene, load: Load) -> None:
        self.scene, self.load, self.notes = scene, load, ""
        self._lock = Lock()

    def page(self) -> Page:
        """Return the page, which asks this server for poses."""
        stage, title = _stage(self.scene), html.escape(self.scene.name)
        told = {"joints": [one for name, joint in self.scene.all_joints() for one in _sliders(name, joint, stage)]}
        data = json.dumps(told, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        return Page(
            "\n".join([
                "<!DOCTYPE html>", '<html lang="en">',
                '<head><meta charset="utf-8"><meta name="viewport" content="width=device-width">',
                f"<title>{title}</title>",
                f'<link rel="icon" href="data:,"><style>{asset("report.css")}{asset("view.css")}</style></head>',
                f"<body><h1>{title}</h1>",
                '<p class="lead">Move a joint; drop a scene, URDF, MJCF or SDF file on the page to see it.</p>',
                player(stage, self.scene.name, "38rem"), f'<p id="said" role="status">{html.escape(self.notes)}</p>',
                '<div id="sliders"></div>',
                f'<script type="application/json" id="view">{data}</script>',
                f"<script>{asset('view.js')}</script></body></html>", "",
            ]),
            self.scene.name,
        )  # fmt: skip

    def moved(self, coordinates: Mapping[str, Any]) -> dict[str, Any]:
        """Move joints to coordinates by name; return poses of the bodies and coordinates of all joints.

        Raises
        ------
        SceneError
            There is no such joint, or a loop does not close there.
        """
        with self._lock:
            wanted = {name: np.atleast_1d(at) for name, at in coordinates.items()}
            self.scene = self.scene.with_state(wanted, adjust=True)
            poses = [body.pose.tolist() for _, body in self.scene.all_bodies()]
            joints = {name: _coordinates(joint).tolist() for name, joint in self.scene.all_joints()}
        return {"poses": [number for pose in poses for number in pose], "coordinates": joints}

    def take(self, name: str, content: bytes) -> None:
        """Show the model of a file instead.

        Raises
        ------
        SceneError, ModelError
            The file has faults.
        """
        with tempfile.TemporaryDirectory() as folder:
            file = FilePath(folder) / FilePath(name).name
            file.write_bytes(content)
            with warnings.catch_warnings(record=True) as heard:
                warnings.simplefilter("always")
                found = self.load(file)
        with self._lock:
            self.scene, self.notes = found, "\n".join(str(one.message).replace(f"{folder}/", "") for one in heard)


def served(posed: Posed, host: str = "127.0.0.1", port: int = 0) -> ThreadingHTTPServer:
    """Return a server of the page, which `serve_forever` runs; port 0 takes any free one.

    It answers its own pages only: a request has to name the address that it listens at.
    """

    class Handler(BaseHTTPRequestHandler):
        def _foreign(self) -> bool:
            """Whether a page of elsewhere asks, which may have another name for this machine."""
            here = [f"{name}:{server.server_address[1]}" for name in (host, "localhost")]
            origin = self.headers.get("Origin")
            return self.headers.get("Host") not in here or (
                origin is not None and origin.removeprefix("http://") not in here
            )

        def do_GET(self) -> None:
            if self._foreign():
                self._answer(HTTPStatus.FORBIDDEN, "", "text/plain")
            elif urlsplit(self.path).path == "/":
                self._answer(HTTPStatus.OK, posed.page().html, "text/html")
            else:
                self._answer(HTTPStatus.NOT_FOUND, "", "text/plain")

        def do_POST(self) -> None:
            asked = urlsplit(self.path)
            if self._foreign():
                self._answer(HTTPStatus.FORBIDDEN, "", "text/plain")
                return
            length = int(self.headers.get("Content-Length") or 0)
            if length > LARGEST:
                self._answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a file of at most {LARGEST} bytes", "text/plain")
                return
            body = self.rfile.read(length)
            try:
                if asked.path == "/pose":
                    self._answer(HTTPStatus.OK, json.dumps(posed.moved(json.loads(body))), "application/json")
                elif asked.path == "/model":
                    name = (parse_qs(asked.query).get("name") or ["model"])[0]
                    posed.take(name, body)
                    self._answer(HTTPStatus.OK, "", "text/plain")
                else:
                    self._answer(HTTPStatus.NOT_FOUND, "", "text/plain")
            except (SceneError, ValueError, OSError) as error:
                self._answer(HTTPStatus.BAD_REQUEST, str(error), "text/plain")

        def _answer(self, status: HTTPStatus, text: str, kind: str) -> None:
            content = text.encode("utf-8")
            self.send_response(status)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: Any) -> None:
            """Print nothing."""

    server = ThreadingHTTPServer((host, port), Handler)
    return server


def _stage(scene: Scene) -> Stage:
    """The scene at one instant."""
    problem = problem_of_scene(scene)
    d = problem.descriptor
    x = problem.point[None, :]
    record = RunRecord(np.zeros(1), x, np.zeros((1, len(d.components))), np.zeros((1, 5)))
    return stage_of(solution_of(problem, record, {}), fps=1.0, duration=None)


def _coordinates(joint: Joint) -> Array:
    return coupling_of(joint).coordinates(joint.coordinate)


def _sliders(name: str, joint: Joint, stage: Stage) -> list[dict[str, Any]]:
    """A slider for each degree of freedom: between the joint's limits, a turn, or the mechanism's size."""
    of, at, size = coupling_of(joint), _coordinates(joint), stage.size()
    turns = np.any(of.basis(joint.coordinate)[:3], axis=0)
    found: list[dict[str, Any]] = []
    for k in range(joint.dim):
        span = np.array([-1.0, 1.0]) * (np.pi if turns[k] else size)
        if joint.limits is not None:
            span = np.where(np.isnan(joint.limits), span, joint.limits)
        found.append({
            "joint": name, "entry": k, "label": name if joint.dim == 1 else f"{name}[{k}]", "start": float(at[k]),
            "low": float(min(span[0], at[k])), "high": float(max(span[1], at[k])), "unit": "rad" if turns[k] else "m",
        })  # fmt: skip
    return found
