"""What is attached to a mechanism: circuits, rotors, gases and heat, with states of their own, by every method."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics import beam_element, joint, rigid_body, tendon, thermoelastic
from ephs.mechanics.elements import components
from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.finding.frames import Unplaced
from ephs.operad import Path
from ephs.solve.posing.problem import Signal
from tests.mechanics.methods.systems import problem_of
from tests.mechanics.tree import machines
from tests.numerics import largest

UNTIL = 0.3


def equations_of(system, start, signals=None):
    """Of a system from states by path, with inputs as (value, whether it is an effort)."""
    states = system.state() | {Path.of(path): np.atleast_1d(np.array(x, dtype=float)) for path, x in start.items()}
    given = {Path.of(p): Signal(np.atleast_1d(x), effort) for p, (x, effort) in (signals or {}).items()}
    return ReducedEquations(problem_of(system, states, given), 0.0)


def motor():
    system, start, inputs = machines.motor_on_four_bar()
    return system, start, {port: (one["effort"], True) for port, one in inputs.items()}


# ---- against equations by hand --------------------------------------------------------------------------------------


def ended(method, **options):
    """(rate of the crank, current, temperature of the housing) at the end, and the solution."""
    system, start, inputs = machines.motor_on_four_bar()
    run = ephs.simulate(system, UNTIL, initial=start, inputs=inputs, method=method, save_at=[0.0, UNTIL], **options)
    assert run.stats["form"] == ("paper" if method == "natural4" else "reduced")
    rate, current = run["rotor.p"][-1] / machines.ROTOR * machines.GEAR, run["coil.b"][-1] / machines.INDUCTANCE
    return np.array([rate, current, machines.THETA * np.exp(run["housing.s"][-1] / machines.HEAT)]).ravel(), run


@pytest.mark.parametrize("method", ["rk54", "rk87", "auto", "radau"])
def test_a_motor_on_a_four_bar_moves_as_equations_by_hand_say(method):
    found, run = ended(method, rtol=1e-11, atol=1e-12)
    assert np.allclose(found, machines.motor_by_hand(UNTIL)[1:], rtol=1e-9, atol=0.0)
    assert run.energy_error.max() < 1e-9


def test_natural4_moves_it_so_too():
    found, run = ended("natural4", step=5e-4, audit="off")
    assert np.allclose(found, machines.motor_by_hand(UNTIL)[1:], rtol=1e-9, atol=0.0)
    assert run.energy_error.max() < 1e-13


def test_the_variational_method_comes_to_the_same_motion():
    exact = machines.motor_by_hand(UNTIL)[1:]
    coarse, fine = (ended("variational", step=step, audit="off")[0] - exact for step in (1e-3, 5e-4))
    assert np.all(np.abs(coarse) < 2e-3 * np.abs(exact))
    assert np.allclose(coarse, 4.0 * fine, rtol=0.05, atol=1e-9)


def sprung(method, **options):
    """(volume and temperature of the gas, temperature of the oil) at the end, and the solution."""
    m = machines
    system, start, inputs = m.gas_spring_on_slider_crank()
    run = ephs.simulate(system, UNTIL, initial=start, inputs=inputs, method=method, save_at=[0.0, UNTIL], **options)
    assert run.stats["form"] == "reduced"
    volume, capacity = run["gas.v"][-1], m.EXPONENT * m.PRESSURE * m.GAS / m.THETA
    hot = m.THETA * (m.GAS / volume) ** (1.0 / m.EXPONENT) * np.exp(run["gas.s"][-1] / capacity)
    return np.array([volume, hot, m.THETA * np.exp(run["oil.s"][-1] / m.OIL)]).ravel(), run


@pytest.mark.parametrize("method", ["rk54", "rk87", "auto"])
def test_a_gas_spring_and_hot_oil_on_a_slider_crank_do_as_equations_by_hand_say(method):
    found, run = sprung(method, rtol=1e-11, atol=1e-12)
    assert np.allclose(found, machines.gas_spring_by_hand(UNTIL)[2:], rtol=1e-9, atol=0.0)
    assert run.energy_error.max() < 1e-9


# ---- derivatives ----------------------------------------------------------------------------------------------------


def warm_beam():
    """A body between two elements that expand, which close a loop over the ground."""
    beam = beam_element(length=0.5, stiffness=[2.0, 3.0, 4.0, 50.0, 40.0, 30.0], damping=0.1, heat=True, expands=True)
    far = beam_element(frame2=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0], length=0.5, stiffness=np.arange(1.0, 7.0), order=4,
                       rest=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], heat=True, expands=True)  # fmt: skip
    pattern = Pattern.from_text(
        "g: body_momentum; p: body_momentum; e1: displacement; e2: displacement; s1: entropy; s2: entropy; "
        "ground(p=g); body(p); wall(s1, s2); first(p1=g, p2=p, e=e1, s=s1); one(e=e1, s=s1); "
        "second(p1=p, p2=g, e=e2, s=s2); two(e=e2, s=s2)"
    )
    store = thermoelastic(capacity=5.0, temperature=310.0, pull=0.4, reference=300.0)
    system = pattern(
        ground=components.ground(), body=rigid_body(1.0, [0.3, 0.4, 0.5]), wall=lib.heat_transfer(h=2.0), first=beam,
        second=far, one=store, two=store,
    )  # fmt: skip
    return system, {"body.pe.q": [1, 0, 0, 0, 0.5, 0, 0]}


def tied_arm():
    """Two bars that hang from each other, a damped tendon from the ground along both, and what pulls it."""
    pin = joint("revolute", [0.6, 0.8, 0, 0, 0.5, 0, 0], [0.6, 0.8, 0, 0, -0.5, 0, 0])
    rope = tendon([([0, 0, 0.4], [0.2, 0.1, 0.1]), ([0.4, 0.0, 0.1], [0.4, 0.2, 0.0])], 30.0, 1.0, 0.7)
    pattern = Pattern.from_text(
        "g: body_momentum; p1: body_momentum; p2: body_momentum; x: momentum, exposed; ground(p=g); arm(p=p1); "
        "hand(p=p2); pin(p1=g, p2=p1); elbow(p1, p2); rope(a1=g, b1=p1, a2=p1, b2=p2, p=x)"
    )
    bar = rigid_body(1.0, [0.3, 0.4, 0.5])
    system = pattern(ground=components.ground(), arm=bar, hand=bar, pin=pin, elbow=pin, rope=rope)
    start = {"arm.pe.q": [1, 0, 0, 0, 1.0, 0, 0], "hand.pe.q": [1, 0, 0, 0, 2.0, 0, 0], "rope.spring.q": 2.0}
    start |= {
        "rope.segment1.pe.q_r": [1, 0, 0, 0, 1.2, 0.1, -0.3],
        "rope.segment2.pe.q_r": [1, 0, 0, 0, 1.0, 0.2, -0.1],
    }
    return system, start, {"x": (-1.5, False)}


def geared():
    return machines.train([(False, 0.3), (True, 0.2), (False, 0.1)], [((0, 1, 2), (1.0, -2.0, 0.5))])


MACHINES = [motor, warm_beam, tied_arm, geared]


@pytest.mark.parametrize("machine", MACHINES)
def test_derivatives_of_what_is_attached_are_those_of_the_equations(machine):
    eq = equations_of(*machine())
    state = eq.start(0.0)
    rng = np.random.default_rng(3)
    r, s = rng.standard_normal(eq.n), eq.heats.entropies(state.heats) + 0.1 * rng.standard_normal(eq.ns)
    bent = eq.moved(state.q, 0.2 * rng.standard_normal(eq.n))
    at = eq.closed(replace(state, q=bent, r=r, heats=eq.heats.energies(s)))
    exact, middle = Jacobian(eq).at(at), eq.vector(at)
    for j, column in enumerate(exact.T):
        step = 1e-5 * max(1.0, abs(middle[j])) * np.eye(middle.size)[j]
        near = (eq.rates(0.0, at.q, middle + step) - eq.rates(0.0, at.q, middle - step))[: exact.shape[0]]
        near /= 2.0 * step[j]
        assert largest(column - near) <= 1e-5 * max(1.0, largest(near))


def assert_dense_rates_agree(eq, state):
    y = eq.vector(state)
    fast, slow = eq.rates(0.0, state.q, y), np.zeros(eq.size)
    assert eq.dense.rates(state.q, y, eq.given, eq.heats, slow) == (0, 0)
    scale = np.maximum(1.0, np.abs(fast[eq.nv :]))
    assert np.all(np.abs(fast[eq.nv :] - slow[eq.nv :]) <= 1e-11 * scale)


@pytest.mark.parametrize("machine", MACHINES)
def test_both_evaluations_are_one(machine):
    eq = equations_of(*machine())
    assert_dense_rates_agree(eq, eq.start(0.0))


# ---- what has no place ----------------------------------------------------------------------------------------------


def with_circuit(**parts):
    """A pendulum's hinge with further boxes: their filling, and their ports' junctions; ``p_r`` is the hinge's."""
    hinge = joint("revolute", driven=True)
    port = next(str(p) for p, of in hinge.interface.items() if str(p) not in ("p1", "p2"))
    junctions = {"g": junction(Q.body_momentum), "p": junction(Q.body_momentum)}
    junctions["p_r"] = junction(hinge.interface[port].quantity)
    boxes = {"ground": {"p": "g"}, "body": {"p": "p"}, "hinge": {"p1": "g", "p2": "p", port: "p_r"}}
    fillings = {"ground": components.ground(), "body": rigid_body(1.0, [0.3, 0.4, 0.5]), "hinge": hinge}
    for name, (filling, ports) in parts.items():
        boxes[name], fillings[name] = ports, filling
        for own, at in ports.items():
            junctions.setdefault(at, junction(filling.interface[Path.of(own)].quantity))
    return Pattern(junctions=junctions, boxes=boxes)(**fillings), junctions["p_r"].quantity


def turning(ratio, quantity):
    return ephs.transformer({"p": Q.angular_momentum, "p_r": quantity}, [[ratio]], name="gear")


@pytest.mark.parametrize(
    ("parts", "effort", "words"),
    [
        (lambda q: {"gear": (turning(0.5, q), {"p": "x", "p_r": "p_r"})}, True, "prescribes the motion of a joint"),
        (
            lambda q: {
                "gear": (turning(0.5, q), {"p": "x", "p_r": "p_r"}),
                "coil": (lib.inductor(l=1.0), {"b": "b"}),
                "other": (lib.inductor(l=2.0), {"b": "c"}),
                "series": (ephs.transformer({"b": Q.flux_linkage, "c": Q.flux_linkage}, [[1]]), {"b": "b", "c": "c"}),
            },
            None,
            "stores what other states",
        ),
    ],
)
def test_what_has_no_place_is_refused_by_path(parts, effort, words):
    quantity = with_circuit()[1]
    system, _ = with_circuit(**parts(quantity))
    signals = {}
    if effort is not None:
        pattern = system.pattern
        junctions = {n: junction(of.quantity, exposed=str(n) == "x") for n, of in pattern.junctions.items()}
        system = Pattern(junctions=junctions, boxes=pattern.boxes)(**{str(b): f for b, f in system.fillings.items()})
        signals = {"x": (1.0, effort)}
    with pytest.raises(Unplaced, match=words):
        equations_of(system, {}, signals)


# ---- efforts that only balances determine ---------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=5), st.floats(0.2, 3.0))
def test_efforts_without_a_storage_follow_from_balances(resistances, ratio):
    """Pairs of brakes in series, side by side on the shaft of a gear: balances divide its rate between each two."""
    quantity = with_circuit()[1]
    parts = {"gear": (turning(ratio, quantity), {"p": "x", "p_r": "p_r"}), "heat": (lib.environment(), {"s": "s"})}
    for i, r in enumerate(resistances):
        parts[f"split{i}"] = (_share(), {"p": "x", "b": f"b{i}", "c": f"c{i}"})
        parts[f"r{i}"] = (lib.rotational_friction(d=r), {"p": f"b{i}", "s": "s"})
        parts[f"t{i}"] = (lib.rotational_friction(d=2.0 * r), {"p": f"c{i}", "s": "s"})
    system, _ = with_circuit(**parts)
    eq = equations_of(system, {})
    assert eq.reduced.attaching.network.unknown == len(resistances)
    state = eq.start(0.0)
    y = eq.vector(state)
    y[eq.nv] = 1.7
    braked = eq.rates(0.0, state.q, y)[eq.nv]
    y[eq.nv] = -1.7
    other = eq.rates(0.0, state.q, y)[eq.nv]
    # each pair is in series: rates add up to the shaft's 1.7/ratio, torques are equal
    torque = sum(1.0 / (1.0 / r + 0.5 / r) for r in resistances) * 1.7 / ratio**2
    assert np.isclose(0.5 * (other - braked) * eq.mass(state.q, state.r)[0, 0], torque, rtol=1e-12)


def _share():
    """The rate of a shaft is the sum of two rates."""
    ports = {"p": Q.angular_momentum, "b": Q.angular_momentum, "c": Q.angular_momentum}
    return ephs.constraint(ports, [[1.0, -1.0, -1.0]], name="share")


def test_balances_hold_where_all_but_the_largest_terms_nearly_vanish():
    """A taut tendon's force and tension are equal but for 1e-13 of them: what rounding leaves is no fault."""
    system, start, _ = tied_arm()
    eq = equations_of(system, start, {"x": (-1.6e-13, False)})
    state = eq.start(0.0)
    y = eq.vector(state)
    still = eq.rates(0.0, state.q, y)[eq.nv : eq.nv + eq.n].copy()
    y[eq.nv : eq.nv + eq.n] = [-2.2e-13, -1.2e-13]
    assert np.allclose(eq.rates(0.0, state.q, y)[eq.nv : eq.nv + eq.n], still, rtol=1e-12)


def _led(ratio):
    """A rotor whose rate is ratio(angle) times the rate of a spring without mass."""
    pattern = Pattern.from_text(
        "q: angle; p: angular_momentum; b: momentum; x: displacement; angle(q); rotor(p); turn(q, p); spring(q=x);"
        "lead(a=b, b=p, q=~q); stretch(q=x, p=b)"
    )
    lead = ephs.transformer({"a": Q.momentum, "b": Q.angular_momentum, "~q": Q.angle}, lambda q: np.array([[ratio(q)]]))
    return pattern(
        angle=ephs.storage({"q": Q.angle}, lambda q: 0.0 * q), rotor=lib.rotor(j=0.02), lead=lead,
        turn=ephs.gyrator({"q": Q.angle, "p": Q.angular_momentum}, [[0.0, -1.0], [1.0, 0.0]]),
        spring=lib.spring(k=10.0), stretch=lib.pkc(),
    )  # fmt: skip


def test_what_holds_a_rate_is_decided_on_all_pieces():
    """A ratio that is 0 on one side and its mirror image: both move alike; one that is 0 everywhere holds a rate."""

    def last(side, ratio):
        start = {"angle.q": 0.8 * side, "rotor.p": 0.002 * side, "spring.q": 0.01 * side}
        run = ephs.simulate(_led(ratio), 0.1, initial=start, method="rk87", step=0.02)
        return np.array([run["angle.q"][-1], run["spring.q"][-1]])

    one, other = last(1.0, lambda q: np.abs(q) + q), last(-1.0, lambda q: np.abs(q) - q)
    assert largest(one + other) <= 1e-14 * largest(one)
    assert abs(one[1]) > 1e-4, "the spring moves"
    with pytest.raises(ephs.OptionError, match="lead holds a rate"):
        last(1.0, lambda q: 0.0 * q)
