"""Springs far too stiff to follow: oscillations that steps pass over are found, and failed runs name them."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import Path, Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.solve.auditing.passing import passed_over
from ephs.solve.equations.oscillations import oscillations
from tests.numerics import largest
from tests.solve.conftest import oscillator
from tests.written import scene_of_text

INERTIA = 0.1 + 1.0 * 0.5**2
"""About the pin, in kg m²."""
MANY = st.floats(-20.0, 20.0).map(lambda power: 10.0**power)


def pendulum(stiffness, **more):
    """A body of 1 kg, 0.5 m beside its pin, held level by a spring in the pin."""
    given = "\n".join(f"{key} = {value!r}" for key, value in {"stiffness": stiffness, **more}.items())
    return scene_of_text(f"""
format = 1
[bodies.arm]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
{given}
""")


def found_in(problem):
    return oscillations(problem, problem.descriptor.pack(problem.initial))


@given(k=MANY, m=MANY)
def test_the_rate_of_a_spring_and_a_mass_is_the_root_of_their_ratio(k, m):
    """At any numbers: no tolerance compares a stiffness with a mass."""
    problem = problem_of_system(oscillator(k, m), {"pe.q": 1.0, "ke.p": m}, {"p": {"flow": 0.0}})
    found = found_in(problem)
    assert found.rates == pytest.approx([np.sqrt(k / m)], rel=1e-12)
    assert found.energies == pytest.approx([0.5 * k + 0.5 * m], rel=1e-12)


@given(k=MANY, m=st.tuples(MANY, MANY).filter(lambda m: 1e-6 < m[0] / m[1] < 1e6))
def test_two_masses_on_one_spring_swing_against_each_other(k, m):
    pattern = Pattern.from_text("q: displacement; p: momentum; p1: momentum; p2: momentum; pe(q); pkc(q, p); "
"first(p=p1); second(p=p2); apart(a=p, b=p1, c=p2)")  # fmt: skip
    apart = ephs.constraint({"a": Q.momentum, "b": Q.momentum, "c": Q.momentum}, [[1.0, 1.0, -1.0]])
    system = pattern(
        pe=lib.spring(k=k), pkc=lib.pkc(), first=lib.point_mass(m=m[0]), second=lib.point_mass(m=m[1]), apart=apart
    )
    found = found_in(problem_of_system(system))
    assert found.rates[-1] == pytest.approx(np.sqrt(k / m[0] + k / m[1]), rel=1e-9)
    assert str(found.springs[-1]) == "pe"


@pytest.mark.parametrize("stiffness", [1e2, 1e10, 1e20, 1e30])
def test_a_spring_in_a_pin_acts_on_all_that_turns_about_it(stiffness):
    found = found_in(problem_of_scene(pendulum(stiffness, rate=1.0)))
    assert found.rates[-1] == pytest.approx(np.sqrt(stiffness / INERTIA), rel=1e-12)
    static = 0.5 * (9.81 * 0.5) ** 2 / stiffness
    assert found.energies[-1] == pytest.approx(0.5 * INERTIA + static, rel=1e-9)
    assert str(found.springs[-1]) == "joints.pin.pe"


@pytest.mark.parametrize("by_hand", [False, True], ids=["scene", "system"])
@pytest.mark.parametrize("stiffness", [1e17, 1e30])
@pytest.mark.parametrize(("method", "step"), [("natural", 0.01), ("natural4", 0.01), ("natural", None)])
def test_steps_do_not_pass_over_an_oscillation_without_a_finding(by_hand, stiffness, method, step):
    """The rate is cos ω t with ω up to 1.7e15 rad/s; results have 1 or −1 at every instant, and keep the energy."""
    scene = pendulum(stiffness, rate=1.0)
    model = scene.system() if by_hand else scene
    with pytest.raises(ephs.SimulationError) as failed, warnings.catch_warnings():
        warnings.simplefilter("ignore", ephs.CostWarning)
        ephs.simulate(model, 1.0, method=method, step=step)
    if isinstance(failed.value, ephs.AuditError):
        (finding,) = failed.value.partial.audit.findings
        assert finding.law == "accuracy" and finding.path.startswith("joints.pin")
    else:
        assert "of joints.pin.pe, has" in str(failed.value)


@pytest.mark.parametrize("stiffness", [1e13, 1e30])
@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_what_hardly_swings_is_at_rest(stiffness, method):
    """The weight turns the pin by 4.9/k rad: the result is right to 1e-12 rad."""
    sol = ephs.simulate(pendulum(stiffness), 1.0, method=method, step=0.01)
    assert not sol.audit.findings
    assert largest(sol.joint("pin").coordinate) <= 2.0 * 9.81 * 0.5 / stiffness * (1.0 + 1e-6)


CARRIED = Pattern.from_text(
    "q: displacement; x: displacement; p: momentum; p1: momentum; p2: momentum; hold(q); first(p); turn(q, p);"
    "pe(q=x); pkc(q=x, p=p1); second(p=p2); apart(a=p1, b=p, c=p2)"
)


@pytest.mark.parametrize("method", ["natural", "natural4"])
@pytest.mark.parametrize("stiffness", [5e3, 2e4])
def test_a_stiff_spring_that_carries_something_along_is_stretched_without_oscillating(stiffness, method):
    """Two masses of 1 kg on springs of 1 N/m and k, in their slow oscillation.

    The control has the stiff spring compressed by as much, which is an oscillation.
    """
    square = 0.5 * (1.0 + 2.0 * stiffness - np.sqrt(1.0 + 4.0 * stiffness**2))
    stretch = square / (stiffness - square)
    apart = ephs.constraint({"a": Q.momentum, "b": Q.momentum, "c": Q.momentum}, [[1.0, 1.0, -1.0]])
    system = CARRIED(
        hold=lib.spring(k=1.0), first=lib.point_mass(m=1.0), turn=lib.pkc(), pe=lib.spring(k=stiffness),
        pkc=lib.pkc(), second=lib.point_mass(m=1.0), apart=apart,
    )  # fmt: skip

    static = stiffness * stretch**2  # of the spring, relative to the largest energy, which is that of 1 N/m
    sizes: dict[float, float] = {}
    for first in (stretch, -stretch):
        start = {"hold.q": 1.0, "pe.q": first}
        sol = ephs.simulate(system, 2.0, initial=start, method=method, step=0.2, audit="off")
        found = passed_over(sol, 0.2, 0.0)
        assert found is not None and found.path == Path.of("pe")
        sizes[first] = found.size / static
    assert sizes[stretch] < 0.01
    assert sizes[-stretch] > 1.0, "the control"


LEAKING = Pattern.from_text(
    "q: displacement; p: momentum, exposed; p1: momentum; p2: momentum; s: entropy; pe(q); pkc(q, p=p1); "
    "mass(p); mf(p=p2, s); env(s); apart(a=p1, b=p, c=p2)"
)


@pytest.mark.parametrize("every", [True, False], ids=["steps", "instants"])
@pytest.mark.parametrize("rtol", [1e-5, 1e-7])
def test_a_mass_whose_spring_gives_way_does_not_oscillate(rtol, every):
    """Oil and its valve: a spring of k behind a damper of d, pulled with F: v tends to F/d, (k/d)² > 4 k/m."""
    apart = ephs.constraint({"a": Q.momentum, "b": Q.momentum, "c": Q.momentum}, [[1.0, -1.0, 1.0]])
    k, d, pull, until = 1e4, 10.0, 50.0, 2.0
    system = LEAKING(
        pe=lib.spring(k=k), pkc=lib.pkc(), mass=lib.point_mass(m=1.0), mf=lib.friction(d=d),
        env=lib.environment(), apart=apart,
    )  # fmt: skip
    run = {"inputs": {"p": {"flow": pull}}, "method": "natural4", "rtol": rtol, "atol": rtol}
    sol = ephs.simulate(system, until, save_at=None if every else [1.6, until], audit="warn", **run)
    assert sol["mass.p"][-1] == pytest.approx(pull / d, abs=100.0 * rtol)
    assert sol.stats["longest_step"] * np.sqrt(k) > 10.0  # else there is nothing to tell apart


@pytest.mark.parametrize("by_hand", [False, True], ids=["scene", "system"])
@pytest.mark.parametrize(
    ("stiffness", "options"),
    [
        (1e30, {"method": "rk87"}),
        (1e30, {"method": "rk54"}),
        (1e30, {"method": "semi"}),
        (1e30, {"method": "radau"}),
        (1e10, {"method": "rk87", "max_steps": 50}),
        (1e10, {"max_steps": 50}),
    ],
    ids=lambda given: "-".join(map(str, given.values())) if isinstance(given, dict) else f"{given:g}",
)
def test_runs_that_fail_at_an_oscillation_name_its_spring_and_frequency(by_hand, stiffness, options):
    scene = pendulum(stiffness, rate=1.0)
    with pytest.raises(ephs.SimulationError) as failed:
        ephs.simulate(scene.system() if by_hand else scene, 1.0, **options)
    rate = np.sqrt(stiffness / INERTIA)
    assert f"of joints.pin.pe, has {rate:.3g} rad/s ({rate / (2.0 * np.pi):.3g} Hz)" in str(failed.value)
    assert "make joints.pin.pe softer, or rigid" in failed.value.advice


def test_runs_that_fail_without_a_fast_oscillation_name_none():
    with pytest.raises(ephs.SimulationError) as failed:
        ephs.simulate(pendulum(1e3, rate=1.0), 1.0, method="rk54", max_steps=3)
    assert "oscillation" not in str(failed.value)
