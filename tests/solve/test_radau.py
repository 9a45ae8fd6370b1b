"""Radau IIA: the published examples against hand-written equations, order, balances, dense output, refusals."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs import Pattern, library
from ephs.solve.methods import passages
from ephs.solve.methods.radau import Radau
from ephs.solve.methods.settling import Settling
from examples import oscillator, physics
from tests.mechanics.plain import uncorrected
from tests.numerics import EPS, largest

K, M, D, T0 = 1.5, 1.0, 0.1, 293.15


def free(_t, y):
    q, p = y
    return [p, -K * q]


def damped(_t, y):
    q, p, _s = y
    return [p, -K * q - D * p, D * p * p / T0]


def springs(_t, y):
    """Together they are one spring of 1.5 N/m, and each has its share."""
    a, b, p = y
    return [0.75 * p, 0.25 * p, -K * (a + b)]


def masses(_t, y):
    q, p, p2 = y
    u = (p + p2) / 1.0
    return [u, -0.4 * K * q, -0.6 * K * q]


def lever(_t, y):
    """The spring moves by half of what the mass does."""
    q, p, _s = y
    return [p / 2.0, -K * q / 2.0 - D * p, D * p * p / T0]


def motor(t, y):
    bs, ss, br, p, sr = y
    heat = [0.5 * np.exp(s / 2.0) for s in (ss, sr)]
    return [
        np.sin(t) - 0.01 * bs,
        0.01 * bs**2 / heat[0],
        np.sin(t) - 0.01 * br - bs * p,
        bs * br - 0.01 * p - 0.1,
        (0.01 * br**2 + 0.01 * p**2) / heat[1],
    ]


def cylinder(_t, y):
    s1, v1, s2, v2, p, s = y
    e1, e2 = (np.exp(entropy / 2.5) * volume ** (-1 / 1.5) for entropy, volume in ((s1, v1), (s2, v2)))
    hot1, hot2, hot = e1 / 2.5, e2 / 2.5, np.exp(s / 2.0) / 2.0
    u = p / 0.5
    return [
        0.01 * (hot - hot1) / hot1,
        0.02 * u,
        0.01 * (hot - hot2) / hot2,
        -0.02 * u,
        0.02 * (e1 / 1.5 / v1 - e2 / 1.5 / v2) - 0.02 * u,
        0.02 * u * u / hot + 0.01 * (hot1 - hot) / hot + 0.01 * (hot2 - hot) / hot,
    ]


DRIVEN = {"q": {"effort": np.sin}, "p": {"flow": -0.1}}
EXAMPLES = {
    # name: (system, right-hand side, states in its order with their initial values, inputs)
    "oscillator": (oscillator.free_oscillator, free, {"osc.pe.q": 1.0, "osc.ke.p": 0.5}, None),
    "damped oscillator": (
        oscillator.damped_oscillator, damped, {"osc.pe.q": 1.0, "osc.ke.p": 0.5, "env.s": 0.0}, None,
    ),
    "springs in series": (physics.springs, springs, {"a.q": 0.3, "b.q": 0.1, "ke.p": 3.0}, None),
    "rigidly linked masses": (physics.masses, masses, {"pe.q": 0.2, "ke.p": 0.4, "other.p": 0.6}, None),
    "lever": (physics.lever, lever, {"pe.q": 1.0, "ke.p": 0.5, "env.s": 0.0}, None),
    "motor": (
        physics.motor,
        motor,
        {"stator.coil.b": 0.3, "stator.tc.s": 1.0, "rotor.coil.b": 0.2, "rotor.mass.p": 0.1, "rotor.tc.s": 1.1},
        DRIVEN,
    ),
    "cylinder and piston": (physics.cylinder, cylinder, physics.CYLINDER_START, None),
}  # fmt: skip


def order_of(case):
    """States in the order of the right-hand side; of the cylinder it is not that of the initial values."""
    if case == "cylinder and piston":
        return ["gas1.s", "gas1.v", "gas2.s", "gas2.v", "piston.mass.p", "piston.tc.s"]
    return list(EXAMPLES[case][2])


def independent(case, times):
    _, slope, start, _ = EXAMPLES[case]
    y0 = [start[name] for name in order_of(case)]
    return solve_ivp(slope, (0.0, times[-1]), y0, method="DOP853", rtol=3e-14, atol=1e-14, t_eval=times).y.T


@pytest.mark.parametrize("case", EXAMPLES)
def test_the_published_examples_have_the_motion_of_their_equations(case):
    system, _, start, inputs = EXAMPLES[case]
    times = np.linspace(1.0, 10.0, 10)
    sol = ephs.simulate(
        system, 10.0, initial=start, inputs=inputs, method="radau", rtol=1e-11, atol=1e-11, save_at=times
    )
    assert np.array_equal(sol.t, times)
    found = np.column_stack([sol[name] for name in order_of(case)])
    assert largest(found - independent(case, times)) <= 1e-9
    assert sol.energy_error.max() <= 1e-9 and sol.stats["least_production"] >= 0.0
    assert (sol.summary()["work"] != 0.0) == (inputs is not None), "supplied work is in the balance"


@pytest.mark.parametrize("case", EXAMPLES)
def test_the_natural_method_has_the_same_motion_and_exact_balances(case):
    system, _, start, inputs = EXAMPLES[case]
    errors = []
    for h in (0.02, 0.01):
        sol = ephs.simulate(system, 2.0, initial=start, inputs=inputs, step=h)
        found = np.array([sol[name][-1] for name in order_of(case)])
        errors.append(largest(found - independent(case, np.array([2.0]))[-1]))
        assert sol.energy_error.max() <= 1e-11
    assert errors[1] <= 1e-3 and np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("case", ["damped oscillator", "springs in series", "cylinder and piston"])
def test_constant_steps_have_order_five(case):
    """The balance of energy lowers no order: where nothing is lost, it is the larger part of an error."""
    system, _, start, _ = EXAMPLES[case]
    exact = independent(case, np.array([2.0]))[-1]

    def errors():
        found = []
        for h in (0.2, 0.1, 0.05):
            sol = ephs.simulate(system, 2.0, initial=start, method="radau", step=h, rtol=1e-10, atol=1e-12, audit="off")
            found.append(largest(np.array([sol[name][-1] for name in order_of(case)]) - exact))
            assert len(sol.t) == round(2.0 / h) + 1
        return np.array(found)

    corrected = errors()
    with uncorrected():
        plain = errors()
    assert np.log2(plain[1] / plain[2]) == pytest.approx(5.0, abs=0.5)
    assert np.log2(corrected[1] / corrected[2]) >= 4.5
    assert np.all(corrected <= 1.5 * plain)


SOURCED = Pattern.from_text("u: charge, exposed; q: charge; b: flux_linkage; fed(q=u); cap(q); coil(b); emc(q, b)")(
    fed=library.capacitor(c=0.3), cap=library.capacitor(c=0.5), coil=library.inductor(l=2.0), emc=library.emc()
)
"""A capacitor at a prescribed voltage beside a circuit without resistance."""


def test_what_is_prescribed_is_not_moved_with_the_energy(monkeypatch):
    """Its charge is c u(t) in all kept states, which the circuit's energy leaves as it is."""

    def missed():
        sol = ephs.simulate(
            SOURCED, 5.0, initial={"fed.q": 0.3, "cap.q": 1.0}, inputs={"u": {"effort": np.cos}}, method="radau",
            step=0.5, audit="off",
        )  # fmt: skip
        assert sol.energy_error.max() <= 1e-13 and sol.stats["plain_defect"]["largest"] > 1e-5
        return largest(np.ravel(sol["fed.q"]) - 0.3 * np.cos(sol.t))

    assert missed() <= 8.0 * EPS * 0.3
    monkeypatch.setattr(Radau, "_filtered", lambda self, h, changes: changes)
    assert missed() > 1e-7, "the control"


OSCILLATING = "q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)"
GASES = "s: entropy; v: volume; z: entropy; w: volume; gas(s, v); other(s=z, v=w); wall(s1=s, s2=z)"


@pytest.mark.parametrize("step", [0.05, 0.2])
@pytest.mark.parametrize("energy", [3e2, 3e6, 3e9, 3e11])
def test_what_entropies_of_large_stores_miss_moves_nothing_beside_them(energy, step, monkeypatch):
    """Two gases that share a wall, and an oscillator of 0.5 J that nothing couples to them."""
    parts = {"pe": library.spring(k=1.0), "ke": library.point_mass(m=1.0), "pkc": library.pkc()}
    gas = library.ideal_gas(c1=energy, c2=energy / 300.0, v0=1.0, c=1.5)
    gases = {"gas": gas, "other": gas, "wall": library.heat_transfer(h=energy / 600.0)}
    beside = Pattern.from_text(f"{GASES}; {OSCILLATING}")(**parts, **gases)

    def missed(system, **start):
        start = {"pe.q": 1.0, **start}
        sol = ephs.simulate(system, 3.0, initial=start, method="radau", step=step, audit="off")
        return largest(np.ravel(sol["pe.q"]) - np.cos(sol.t))

    with uncorrected():
        plain = missed(Pattern.from_text(OSCILLATING)(**parts))
    volumes = {"gas.v": 1.0, "other.v": 0.5}
    assert missed(beside, **volumes) <= 1.01 * plain
    monkeypatch.setattr(Settling, "missed", lambda *_: 0.0)
    assert missed(beside, **volumes) > 10.0 * plain or step > 0.1, "the control"


def test_what_an_environment_takes_from_outside_costs_no_steps():
    """Its energy is linear in its entropy, so that its entropy misses nothing, also where a port supplies it."""
    text = f"s: entropy, exposed; {OSCILLATING}; mf(p, s); env(s)"
    system = Pattern.from_text(text)(
        pe=library.spring(k=1.0),
        ke=library.point_mass(m=1.0),
        pkc=library.pkc(),
        mf=library.friction(d=0.1),
        env=library.environment(),
    )
    sol = ephs.simulate(
        system, 2.0, initial={"pe.q": 1.0}, inputs={"s": {"flow": lambda t: 0.3 + np.sin(t)}}, method="radau", rtol=1e-8
    )
    assert sol.stats["steps"] < 200
    supplied = 0.3 * 2.0 + 1.0 - np.cos(2.0)
    assert float(sol["env.s"][-1]) == pytest.approx(supplied + sol.heat[-1] / 293.15, rel=1e-9)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_the_error_keeps_to_the_tolerance(tolerance):
    system, _, start, _ = EXAMPLES["cylinder and piston"]
    sol = ephs.simulate(system, 10.0, initial=start, method="radau", rtol=tolerance, atol=tolerance)
    found = np.array([sol[name][-1] for name in order_of("cylinder and piston")])
    assert largest(found - independent("cylinder and piston", np.array([10.0]))[-1]) <= 10.0 * tolerance


def test_stiffness_costs_no_steps():
    """A friction of 10⁶ kg/s slows the mass in microseconds; what is left is slow."""
    stiff = oscillator.damped(
        osc=oscillator.oscillator(pe=library.spring(k=1.5), ke=library.point_mass(m=1.0), pkc=library.pkc()),
        mf=library.friction(d=1e6),
        env=library.environment(),
    )
    sol = ephs.simulate(stiff, 10.0, initial={"osc.pe.q": 1.0, "osc.ke.p": 1.0}, method="radau", rtol=1e-6, atol=1e-9)
    assert sol.stats["steps"] < 200
    assert sol["osc.pe.q"][-1] == pytest.approx(np.exp(-1.5e-6 * 10.0) + 1e-6, abs=1e-8)
    assert sol.energy_error.max() <= 1e-6


def test_what_was_computed_is_kept_when_a_run_ends_early():
    start = {"osc.pe.q": 1.0}
    with pytest.raises(ephs.SimulationError, match="more steps than are allowed") as caught:
        ephs.simulate(oscillator.free_oscillator, 10.0, initial=start, method="radau", max_steps=5)
    assert len(caught.value.partial.t) == 6 and caught.value.partial.t[-1] == caught.value.time
    with pytest.raises(ephs.SimulationError, match="below the smallest") as caught:
        ephs.simulate(
            oscillator.free_oscillator, 10.0, initial=start, method="radau", min_step=5.0, rtol=1e-12, atol=1e-12
        )


BRAKE = Pattern.from_text("p: momentum; s: entropy; ke(p); mf(p, s); env(s)")


def stopped(friction, *, store=None, **options):
    """A mass of 1 kg at 100 m/s, 5000 J, whose friction warms the environment or a capacity."""
    parts = {"ke": library.point_mass(m=1.0), "mf": library.friction(d=friction)}
    system = BRAKE(**parts, env=store or library.environment())
    return ephs.simulate(system, 1.0, initial={"ke.p": 100.0}, method="radau", audit="off", **options)


@pytest.mark.parametrize("step", [0.002, 0.05, None])
@pytest.mark.parametrize("friction", [20.0, 1e4, 1.3e6, 1e7])
def test_a_brake_put_together_by_hand_makes_heat_of_all_that_it_takes(friction, step):
    """Its heat is ½ (p⁰² − p¹²)/m to rounding of N steps, also within steps."""
    times = np.linspace(0.0, 1.0, 8)
    sol = stopped(friction, save_at=times, **({"step": step} if step else {"rtol": 1e-6}))
    lost = 5000.0 - 0.5 * np.ravel(sol["ke.p"]) ** 2
    allowed = 10.0 * np.sqrt(sol.stats["steps"]) * 10.0 * EPS * 5000.0
    assert largest(np.ravel(sol["env.s"]) * 293.15 - lost) <= allowed
    assert sol.energy_error.max() * 5000.0 <= allowed and abs(sol.summary()["heat"] - lost[-1]) <= allowed
    assert np.all(np.diff(np.ravel(sol["env.s"])) >= -8.0 * EPS * 20.0)


def test_without_the_energy_the_quadrature_misses_it(monkeypatch):
    """The control."""
    monkeypatch.setattr(passages, "heat_of_friction", lambda flows, *_: flows)
    assert stopped(1e6, step=0.002).summary()["heat"] < 100.0


def test_a_capacity_takes_the_energy_that_the_mass_lost():
    """E = c1 (exp(s/c2) − 1), at chosen steps."""
    sol = stopped(20.0, store=library.thermal_capacity(c1=300.0, c2=1.0), rtol=1e-6)
    held = 300.0 * np.expm1(np.ravel(sol["env.s"])[-1])
    assert abs(held - 5000.0 + 0.5 * np.ravel(sol["ke.p"])[-1] ** 2) <= 1e-9
    assert sol.entropy_production.sum() == pytest.approx(np.ravel(sol["env.s"])[-1], rel=1e-12)
