"""Videos of mechanisms: as many frames as the film, one frame for all, and what cannot be written is refused."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import ephs
from ephs.show import ShowError, write_video
from ephs.show.motions.video import VIDEOS
from tests.oscillator import free_oscillator

SCENE = """
format = 1
name = "pendulum"
[bodies.rod]
mass = 1.0
inertia = [0.08, 0.08, 0.001]
shape = { box = [0.05, 0.05, 1.0] }
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
frame1 = { rotation = { axis = [0, 1, 0], angle_deg = 90 } }
frame2 = { position = [0.0, 0.0, 0.5], rotation = { axis = [0, 1, 0], angle_deg = 90 } }
coordinate = 1.5
"""


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    file = tmp_path_factory.mktemp("swing") / "pendulum.toml"
    file.write_text(SCENE, encoding="utf-8")
    return ephs.simulate(ephs.load(file), 0.5, save_at=np.linspace(0.0, 0.5, 6))


def frames(file):
    with Image.open(file) as picture:
        for k in range(picture.n_frames):
            picture.seek(k)
            yield np.asarray(picture.convert("L"), dtype=float)


def test_a_gif_shows_the_motion_in_a_fixed_frame(swing, tmp_path):
    write_video(swing, tmp_path / "a.gif", fps=10.0)
    seen = list(frames(tmp_path / "a.gif"))
    assert len(seen) == 6 and len({each.shape for each in seen}) == 1
    ink = [each < 250.0 for each in seen]
    for one, other in pairwise(ink):
        assert (one != other).sum() > 0.002 * one.size  # the rod moves on
    edges = [(each[0].any(), each[-1].any(), each[:, 0].any(), each[:, -1].any()) for each in ink]
    assert not np.any(edges)  # and never leaves the frame


def test_the_joint_on_the_ground_stays_where_it_is(swing, tmp_path):
    """The frame is one for all instants: the support is in all pictures at the same place."""
    write_video(swing, tmp_path / "a.gif", fps=10.0)
    seen = np.array(list(frames(tmp_path / "a.gif")))
    dark = (seen < 100.0).all(axis=0)
    assert dark.sum() > 20


def test_other_endings_and_missing_programs_are_named(swing, tmp_path, monkeypatch):
    with pytest.raises(ShowError, match=r"a\.avi.*\.gif, \.mp4, \.webm"):
        write_video(swing, tmp_path / "a.avi")
    monkeypatch.setitem(VIDEOS, ".mp4", "nothing")
    with pytest.raises(ShowError, match="ffmpeg"):
        write_video(swing, tmp_path / "a.mp4")
    with pytest.raises(ShowError, match="fps"):
        write_video(swing, tmp_path / "a.gif", fps=0.0)
    assert not list(tmp_path.iterdir())


def test_systems_without_bodies_are_refused(tmp_path):
    sol = ephs.simulate(free_oscillator(), 0.1, initial={"pe.q": 1.0}, step=0.05)
    with pytest.raises(ShowError, match="bodies"):
        write_video(sol, tmp_path / "a.gif")
