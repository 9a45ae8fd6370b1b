"""Linear and angular momentum in every step: of mechanisms that nothing holds, with the balance of energy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.methods import registry
from ephs.solve.running import loop
from tests.mechanics.momenta import floating, momenta
from tests.numerics import largest
from tests.scenes import equations_of, shipped
from tests.written import scene_of_text

METHODS = {
    **{name: {"rtol": 1e-4, "atol": 1e-4} for name in ("rk54", "rk87", "radau", "auto", "semi")},
    "variational": {"step": 0.04},
}
BOTH = {"keep": "energy and momenta"}
ROUNDING = 4e-14
"""Of sums of some twenty terms, relative to these: 8 n ε."""
LIMITS = settings(max_examples=2)


def run(scene, method, options, until=0.4):
    return ephs.simulate(scene, until, method=method, options=options, audit="off", **METHODS[method])


def drift(scene, sol, columns=slice(None)):
    """The largest change of momenta, relative to the largest of the bodies' momenta."""
    found, size = momenta(scene, sol), 1e-3
    for name, body in scene.all_bodies():
        motion = sol.body(name)
        far = 1.0 + np.linalg.norm(motion.position, axis=1).max()
        size += body.mass * far * (largest(motion.velocity) + largest(motion.angular_velocity))
    return float(np.abs(found - found[0])[:, columns].max() / size)


@pytest.mark.parametrize("method", METHODS)
@LIMITS
@given(data=st.data())
def test_steps_keep_momenta_and_the_balance_where_nothing_holds_a_mechanism(method, data):
    """Trees and closed loops with springs and friction, in free flight.

    Loops start at rest relative to their base: long steps that move rates alone leave energy to those that follow.
    """
    scene = data.draw(floating(kinds=("revolute", "spherical")))
    sol = run(scene, method, BOTH)
    first = len(sol) // 2 if method == "variational" else 0
    assert drift(scene, sol) <= ROUNDING and sol.energy_error[first:].max() <= ROUNDING
    assert sol.stats["momenta"] == 6


@given(scene=floating(springs=False, friction=False, kinds=("revolute", "spherical")))
@LIMITS
def test_under_gravity_what_lies_across_is_kept(scene):
    scene = replace(scene, world=replace(scene.world, gravity=np.array([0.0, 0.0, -9.81])))
    sol = run(scene, "rk54", BOTH)
    assert sol.stats["momenta"] == 3
    assert drift(scene, sol, [0, 1, 5]) <= ROUNDING and sol.energy_error.max() <= ROUNDING
    assert drift(scene, sol, [2]) > 1e3 * ROUNDING


@pytest.mark.parametrize("method", METHODS)
def test_without_the_option_momenta_drift(method):
    """The control; steps of the variational method keep them by themselves, not with its energies corrected."""
    scene = shipped("mbs")
    assert drift(scene, run(scene, method, {"keep": "energy"}, 0.2)) > 1e2 * ROUNDING
    assert drift(scene, run(scene, method, BOTH, 0.2)) <= ROUNDING


@pytest.mark.parametrize("method", ["rk87", "radau"])
def test_instants_within_steps_keep_them_too(method):
    scene = shipped("mbs")
    times = np.linspace(0.0, 0.4, 32)
    sol = ephs.simulate(scene, 0.4, method=method, options=BOTH, audit="off", save_at=times, **METHODS[method])
    assert sol.stats["steps"] < len(times) and drift(scene, sol) <= ROUNDING


def test_variational_steps_keep_momenta_by_themselves():
    scene = shipped("mbs")
    sol = run(scene, "variational", {"keep": "momentum"})
    assert drift(scene, sol) <= ROUNDING and sol.energy_error.max() > 1e2 * ROUNDING


@pytest.mark.parametrize(("name", "kept"), [("heavy-top", 1), ("four-bar", 0), ("slider-crank", 0), ("mbs", 6)])
def test_what_is_held_keeps_fewer(name, kept):
    """A top keeps what turns it about the vertical; a crank keeps nothing."""
    eq = equations_of(shipped(name))
    eq.accounts.keep("energy and momenta")
    assert int(np.any(eq.engine.tables["bases"].reshape(-1, 6, 6), axis=1).sum()) == kept


@pytest.mark.parametrize(("method", "order"), [("rk54", 5), ("variational", 2)])
def test_keeping_momenta_leaves_the_order_as_it_is(method, order):
    scene, ends = shipped("mbs"), []
    exact = ephs.simulate(scene, 0.8, method="rk87", rtol=1e-13, atol=1e-13)
    for step in (0.1, 0.05):
        sol = ephs.simulate(scene, 0.8, method=method, step=step, options=BOTH, audit="off")
        ends.append(max(largest(sol.body(b).position[-1] - exact.body(b).position[-1]) for b, _ in scene.all_bodies()))
    assert np.log2(ends[0] / ends[1]) > order - 0.6


def test_an_option_that_there_is_not_is_refused():
    scene = shipped("mbs")
    for method in ("rk87", "auto", "radau"):
        with pytest.raises(ephs.OptionError, match="'energy and momenta'"):
            run(scene, method, {"keep": "momenta"})


HEAD = "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n"
BALL = """
[bodies.{name}]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [{place}, 0.0, 0.0]
velocity = [{speed}, 0.1, 0.0]
[surfaces.{name}]
body = "{name}"
shape = {{ sphere = 0.1 }}
"""
PAIR = """
[bodies.one]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
[bodies.two]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.5, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["one", "two"]
at = [0.3, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
rate = 1.0
limits = [-0.1, 0.1]
"""


def meeting(what, law):
    """Two free bodies whose surfaces, or the stops of whose joint, meet after 0.1 s."""
    balls = [
        BALL.format(name=name, place=place, speed=-5.0 * place) + law for name, place in (("a", -0.15), ("b", 0.15))
    ]
    return scene_of_text(HEAD + ("\n".join(balls) if what == "surfaces" else PAIR + law))


@pytest.mark.parametrize("method", [*(name for name, one in registry.METHODS.items() if one.impacts), "auto"])
@pytest.mark.parametrize(
    ("what", "law", "path"),
    [("surfaces", "restitution = 0.5", r"contacts\.a_b"), ("stops", "limit_restitution = 0.5", r"joints\.pin")],
)
def test_momenta_are_refused_beside_impulses_before_anything_is_done(what, law, path, method, tmp_path):
    """And what is hard is named."""
    scene, journal = meeting(what, law), tmp_path / "run.journal"
    with pytest.raises(ephs.OptionError, match=rf"'keep'\] is 'energy and momenta', expected 'energy': {path}"):
        ephs.simulate(scene, 0.2, method=method, options=BOTH, journal=journal)
    assert not journal.exists()


@pytest.mark.parametrize(("what", "law"), [("surfaces", "restitution = 0.5"), ("stops", "limit_restitution = 0.5")])
def test_the_balance_alone_is_kept_beside_impulses(what, law):
    sol = run(meeting(what, law), "rk54", {"keep": "energy"})
    assert any(event.name.endswith("strikes") for event in sol.events) and sol.energy_error.max() <= ROUNDING


@pytest.mark.parametrize(
    ("what", "law"), [("surfaces", "stiffness = 1e3\nloss = 0.2"), ("stops", "limit_stiffness = 100.0")]
)
def test_momenta_are_kept_through_elastic_blows(what, law):
    scene = meeting(what, law)
    sol = run(scene, "rk54", BOTH)
    assert sol.potential.max() > 0.0  # they meet
    assert sol.stats["momenta"] == 6 and drift(scene, sol) <= ROUNDING and sol.energy_error.max() <= ROUNDING


CART = """format = 1
[world]
gravity = [0.0, 0.0, -9.81]
[bodies.cart]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [0.3, 0.0, 0.0]
[bodies.bob]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [1.3, 0.0, 0.0]
velocity = [0.4, 0.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.3, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
rate = 0.4
[joints.pin]
type = "revolute"
bodies = ["cart", "bob"]
at = [0.3, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
"""


def test_a_cart_on_a_level_rail_keeps_its_momentum_along_it():
    """A mechanism in a plane, held but for one direction."""
    scene = scene_of_text(CART)
    for method in ("rk54", "rk87"):
        sol = run(scene, method, BOTH)
        assert sol.stats["momenta"] == 1
        assert drift(scene, sol, [0]) <= ROUNDING < drift(scene, sol, [2])
        assert drift(scene, run(scene, method, {"keep": "energy"}), [0]) > ROUNDING


@pytest.mark.parametrize(("method", "step"), [("rk54", 4e-5), ("radau", 2.5e-2)])
def test_a_run_that_was_stopped_goes_on_with_the_momenta_that_it_had(method, step, tmp_path):
    def stop(t, *_):
        if t > 0.12:
            raise RuntimeError

    def going(**more):
        times = np.linspace(0.0, 0.4, 9)
        return ephs.simulate(scene, 0.4, method=method, step=step, options=BOTH, audit="off", save_at=times, **more)

    scene, journal = shipped("mbs"), tmp_path / "run.journal"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "RESPONSE", -1.0)  # progress is told at every step
        patch.setattr(loop, "BURST", 8)  # of compiled ones after so many
        with pytest.raises(ephs.SimulationError) as stopped:
            going(journal=journal, progress=stop)
    assert 0.0 < stopped.value.time < 0.4
    whole, again = going(), going(journal=journal)
    assert all(np.array_equal(whole[str(path)], again[str(path)]) for path in whole.states)
