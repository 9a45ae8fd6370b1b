"""Other programs on the scenes: they compute the same motions, or say what they cannot do."""

import pytest

import ephs
from benchmarks.peers.measure import work_precision
from benchmarks.peers.programs import PEERS
from benchmarks.peers.scene import PeerError
from ephs.show.charts import FAMILIES, tight_reference
from ephs.show.charts.runs import RunEnding
from tests.scenes import ROOT, shipped


@pytest.mark.parametrize("file", ["scenes/chain.toml", "benchmarks/scenes/spherical-chain-2.toml"])
@pytest.mark.parametrize("peer", ["pin DOP853", "mujoco RK4"])
def test_peers_compute_the_same_motion(file, peer):
    scene = ephs.load(ROOT / file)
    truth = tight_reference(scene, 0.5)
    setting = {"tolerances": (1e-12,), "steps": (2000,)}
    (point,) = work_precision(scene, 0.5, [peer], reference=truth, repeats=1, **setting)
    assert point.outcome is RunEnding.DONE
    assert point.error < 1e-9


@pytest.mark.parametrize(
    ("name", "peer", "until", "bound"),
    [
        ("four-bar-windows-1", "pin DOP853", 0.5, 1e-8),
        ("four-bar-windows-1", "pin soft DOP853", 0.5, 1e-8),
        ("four-bar-windows-1", "mujoco RK4", 0.5, 1e-8),
        ("four-body-loop", "pin DOP853", 0.2, 1e-8),
        ("four-body-loop", "mujoco RK4", 0.2, 1e-6),
        ("andrews-squeezer", "mujoco RK4", 0.01, 1e-6),
    ],
)
def test_peers_close_loops_pull_springs_and_drive(name, peer, until, bound):
    scene = ephs.load(ROOT / f"benchmarks/scenes/{name}.toml")
    setting = {"tolerances": (1e-10,), "steps": (4000,)}
    (point,) = work_precision(scene, until, [peer], reference=tight_reference(scene, until), repeats=1, **setting)
    assert point.outcome is RunEnding.DONE, point.message
    assert point.error < bound


def test_peers_carry_free_and_fixed_bodies():
    free = FAMILIES["long-spin"].make(1.0)
    truth = tight_reference(free, 1.0)
    for peer in ("pin DOP853", "mujoco RK4"):
        (point,) = work_precision(free, 1.0, [peer], reference=truth, tolerances=(1e-12,), steps=(2000,), repeats=1)
        assert point.error < 1e-9


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("file", ["four-bar", "slider-crank", "mbs", "universal"])
def test_peers_refuse_what_they_cannot_do(file, peer):
    scene = shipped(file)
    with pytest.raises(PeerError, match="expected"):
        PEERS[peer].prepare(scene, 1.0)
    assert work_precision(scene, 1.0, [peer], reference=tight_reference(scene, 0.01))[0].outcome is RunEnding.REFUSED
