"""The global error of constant steps: growth and cancellation of the errors of steps are in its estimate."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.show.charts import family_scenes as scenes
from ephs.solve.auditing import audit, growth
from ephs.solve.auditing.growth import FEW, Again, global_error

ALLOWED = 0.1
END = 3.0


@pytest.fixture
def estimates(monkeypatch):
    """What audits estimate, with the sums of the errors of single steps."""
    found = []

    def kept(solution, order, h, summed, allowed, again):
        estimate = global_error(solution, order, h, summed, allowed, again)
        found.append((estimate, summed()))
        return estimate

    monkeypatch.setattr(audit, "global_error", kept)
    return found


def unstable():
    """A pendulum beside its upper equilibrium: errors grow by e^(t √(1.5 g/l)), 10⁵ times in three seconds."""
    return scenes.pendulum(3.1415)


def off(sol, true):
    """Distance of bodies from a motion at the same times, in lengths of the mechanism or rad."""
    length = sol.problem.length
    return max(
        float(growth.apart(sol.states[path], true.states[path], length).max())
        for path in (slot.path for slot in sol.problem.descriptor.states if slot.quantity.kind == "pose")
    )


@cache
def motion(make, end, times):
    """Of what is made, but for rounding."""
    return ephs.simulate(make(), end, method="rk87", rtol=1e-13, atol=1e-13, save_at=times, audit="off")


@pytest.mark.parametrize(
    ("make", "end"), [(unstable, END), (lambda: scenes.heavy_top(20.0), 0.5), (lambda: scenes.four_bar_back(0.0), 0.5)]
)
@pytest.mark.parametrize("method", ["natural", "variational", "natural4", "rk54"])
def test_the_estimate_is_the_error(method, make, end, estimates):
    """To a tenth at order 2; at higher ones steps are so long that their errors are not of their order only."""
    sol = ephs.simulate(make(), end, method=method, step=0.01, audit="off")
    assert sol.audit.passed
    ((estimate, _),) = estimates
    error = off(sol, motion(make, end, tuple(sol.t.tolist())))
    assert estimate.resolved
    if METHODS[method].order == 2:
        assert estimate.size == pytest.approx(error, rel=0.1)
    else:
        assert 0.1 * error <= estimate.size <= 1e-5


@pytest.mark.parametrize("method", ["natural", "variational"])
def test_errors_that_grow_are_found_where_their_sum_passes(method, estimates):
    """The sum of the errors of steps knows nothing of growth: it is the control."""
    with pytest.raises(ephs.AuditError, match="accuracy") as caught:
        ephs.simulate(unstable(), END, method=method, step=0.06)
    ((estimate, summed),) = estimates
    assert summed < ALLOWED < estimate.size
    short = float(caught.value.findings[0].advice.split()[5])
    assert short < 0.06
    assert ephs.simulate(unstable(), END, method=method, step=short).audit.passed


def drift(order, growing, h, far=np.inf):
    """A run of a method of an order whose errors are C hᵖ, up to some distance."""
    t = np.arange(0.0, 1.0 + 0.5 * h, h)
    poses = np.zeros((t.size, 7))
    poses[:, 0] = 1.0
    poses[:, 4] = np.minimum(growing * t * h**order, far)
    slot = SimpleNamespace(path="body", quantity=SimpleNamespace(kind="pose"))
    problem = SimpleNamespace(length=1.0, descriptor=SimpleNamespace(states=[slot]))
    totals = SimpleNamespace(heat=np.zeros(t.size), work=np.zeros(t.size), scale=1.0)

    class Run(SimpleNamespace):
        def __len__(self):
            return len(self.t)

    return Run(t=t, states={"body": poses}, problem=problem, ledgers=totals, stats={"steps": t.size - 1})


@pytest.mark.parametrize("order", [1, 2, 4, 8])
@pytest.mark.parametrize("summed", [1e-12, 1e-4, 1e-2])
def test_errors_of_the_order_are_found_exactly(order, summed):
    h, taken = 1.0 / 240.0, []
    size = 0.02

    def again(step, _):
        taken.append(step / h)
        return drift(order, size / h**order, step)

    found = global_error(drift(order, size / h**order, h), order, h, lambda: summed, ALLOWED, Again(again, None))
    assert found.resolved
    assert found.size == pytest.approx(size, rel=1e-9)
    assert found.path == "body"
    assert taken == sorted(taken, reverse=True)


def test_what_is_far_apart_is_not_resolved():
    def elsewhere(step, _):
        return drift(2, 3e6, step, far=2.0)

    h = 0.01
    found = global_error(drift(2, 1e6, h, far=0.5), 2, h, lambda: 1e-3, ALLOWED, Again(elsewhere, None))
    assert not found.resolved
    assert found.size > ALLOWED


def test_steps_that_fail_are_made_shorter_and_say_nothing_where_none_succeeds():
    h, tried = 0.01, []

    def fails(step, _):
        tried.append(round(step / h, 9))
        raise ArithmeticError

    assert global_error(drift(2, 1.0, h), 2, h, lambda: 1e-6, ALLOWED, Again(fails, None)) is None
    assert tried == [25, 8, 2, 0.5]


@pytest.mark.parametrize(("far", "agrees"), [(0.0, True), (0.5, False)])
def test_another_method_that_agrees_is_enough(far, agrees):
    h, tried = 1.0 / (2 * FEW), []

    def coarser(step, _):
        tried.append(step)
        return drift(2, 0.0, step)

    def independent(times, most):
        assert most == FEW
        return drift(0, far, h)

    found = global_error(drift(2, 0.0, h), 2, h, lambda: 1e-1, ALLOWED, Again(coarser, independent))
    assert found.size == 0.0
    assert (not tried) == agrees


def test_inputs_that_read_the_state_are_not_given_again(estimates):
    """They may remember what they were asked."""
    asked = []

    def hold(t, state):
        asked.append(t)
        return -float(state["joints.pin.pe.q_r"][0])

    scene = scenes.pendulum(0.5)
    name = next(iter(scene.joints))
    own = ephs.simulate(scene, 0.5, method="natural", step=0.01, inputs={f"joints.{name}": lambda t: 0.1 * t})
    assert own.audit.passed and len(estimates) == 1
    given = {f"joints.{name}": lambda t, state: hold(t, {"joints.pin.pe.q_r": [0.0]})}
    again = ephs.simulate(scene, 0.5, method="natural", step=0.01, inputs=given)
    assert again.audit.passed and len(estimates) == 1
