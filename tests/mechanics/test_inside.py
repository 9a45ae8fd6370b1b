"""A mechanism in a larger system reads like the mechanism alone."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs.mechanics.motion.inside import Inside
from ephs.mechanics.scene.build import initial_state
from ephs.show import animate
from tests.scenes import shipped


@pytest.fixture(scope="module", params=["mbs", "hot-brake", "biped"])
def both(request):
    """The motion of a scene, and of it as the only box of a pattern."""
    scene = shipped(f"{request.param}")
    steps = {"method": "natural", "form": "paper", "step": 0.002}
    alone = ephs.simulate(scene, 0.02, **steps)
    start = {f"left.engine.{path}": value for path, value in initial_state(scene).items()}
    wrapped = Pattern({}, {"left": {}})(left=Pattern({}, {"engine": {}})(engine=scene.system()))
    return alone, Inside(ephs.simulate(wrapped, 0.02, initial=start, **steps), "left.engine", scene)


def test_it_reads_like_the_scene_alone(both):
    alone, part = both
    scene = alone.scene
    assert len(part) == len(alone) and np.array_equal(part.t, alone.t) and part.scene is not None
    for name, _ in scene.all_bodies():
        mine, known = part.body(name), alone.body(name)
        for what in ("position", "quaternion", "velocity", "angular_velocity"):
            assert getattr(mine, what) == pytest.approx(getattr(known, what), abs=1e-9)
        assert part.point(name, [0.1, 0.2, 0.3]) == pytest.approx(alone.point(name, [0.1, 0.2, 0.3]), abs=1e-9)
    for name, _ in scene.all_joints():
        assert part.joint(name).coordinate == pytest.approx(alone.joint(name).coordinate, abs=1e-9)
        assert part.joint(name).rate == pytest.approx(alone.joint(name).rate, abs=1e-9)
        known = alone.joint(name).wrench
        assert part.joint(name).wrench == pytest.approx(known, abs=1e-9 * (1.0 + np.nanmax(np.abs(known))), nan_ok=True)
    for path in alone:
        assert path in part and str(path) in part and part[path].shape == alone[path].shape
    assert "left.engine" not in part
    for name, _ in scene.all_thermal():
        assert part.thermal(name).temperature == pytest.approx(alone.thermal(name).temperature, rel=1e-12)
    assert part.constraint_error.max() < 1e-12


def test_it_moves_as_a_page(both):
    _, part = both
    assert "viser" in animate(part, fps=10.0).html.lower()


def test_a_scene_that_is_not_there_is_an_error(both):
    alone, _ = both
    with pytest.raises(KeyError, match="no such state"):
        Inside(alone, "nowhere", alone.scene)
