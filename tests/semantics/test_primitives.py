"""Primitives are the structure that they claim to be, or are refused with the condition that fails."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.operad import Path
from ephs.operad import quantity as Q
from ephs.semantics import Reference, StructureError, library
from ephs.semantics.bundles.bundle import Bundle
from ephs.semantics.verdicts.checks import random_efforts, random_point
from ephs.testing import interfaces, irreversibles, reversibles, storages
from tests.numerics import generators, largest
from tests.semantics.subspace import assert_dirac
from tests.semantics.zoo import QP, drag

GASES = (
    library.chemistry.Species("A", {"X": 1}, energy=1e3, entropy=10.0, capacity=20.0),
    library.chemistry.Species("B", {"X": 2}, energy=-2e3, entropy=15.0, capacity=45.0),
)
ARGUMENTS = {
    "coil": {"turns": 40.0}, "conduit": {}, "ideal_mixture": {"species": GASES}, "inertance": {"i": 2e5},
    "laminar_leak": {"c": 1e-3}, "magnetic_series": {}, "orifice": {"c": 1e-2, "transition": 0.5},
    "pipe_loss": {"r": 2.0, "k": 3.0}, "reaction": {"equation": "2 A = B", "species": GASES, "k": 1e-3},
    "reluctance": {"r": 4.0}, "saturating_inductor": {"l": 0.3, "knee": 0.5}, "tank": {"area": 2.0, "density": 1e3},
    "saturating_reluctance": {"r": 4.0, "knee": 0.5}, "winding": {"turns": 40.0},
    "capacitor": {"c": 0.3}, "emc": {}, "environment": {}, "friction": {"d": 0.2}, "heat_transfer": {"h": 3.0},
    "ideal_gas": {"c1": 2.0, "c2": 1.5, "v0": 1.0, "c": 1.5}, "inductor": {"l": 0.4}, "lever": {"r": 2.5}, "mkc": {},
    "piston": {"a": 0.02}, "pkc": {}, "point_mass": {"m": 2.0}, "resistor": {"r": 5.0}, "rigid_link": {},
    "rotational_friction": {"d": 0.3}, "rotor": {"j": 0.1}, "series_springs": {}, "spring": {"k": 1.5},
    "thermal_capacity": {"c1": 3e4, "c2": 100.0},
}  # fmt: skip


@cache
def made(name):
    """A primitive of the library; its verdict, up to two seconds, is asked once."""
    return getattr(library, name)(**ARGUMENTS[name])


def test_every_primitive_of_the_library_is_tested():
    assert set(ARGUMENTS) == set(library.__all__)


@pytest.mark.parametrize("name", library.__all__)
@given(rng=generators)
def test_the_conditions_hold_of_the_library(name, rng):
    _conditions(made(name), rng)


@given(st.data(), generators)
def test_the_conditions_hold_of_what_is_drawn(data, rng):
    interface = data.draw(interfaces(min_ports=1, max_ports=3))
    kind = data.draw(st.sampled_from([reversibles, irreversibles]))
    _conditions(data.draw(kind(interface)), rng)


def _conditions(primitive, rng):
    """Dirac and conserving, or Onsager and conserving; measured against the sums of absolute terms."""
    bundle, reference = primitive.bundle, Reference()
    x, e = random_point(bundle, primitive.reads, rng), random_efforts(bundle, rng)
    intensive = bundle.intensive(reference)
    if primitive.kind == "reversible":
        skew, constraint = primitive.structure(x)
        lam, drawn = rng.standard_normal(constraint.shape[0]), np.abs(e)
        e = e - np.linalg.pinv(constraint) @ (constraint @ e) if constraint.size else e
        f = skew @ e + constraint.T @ lam
        # e is what a projection left of what was drawn
        scale = drawn @ (np.abs(skew) @ drawn + np.abs(constraint.T) @ np.abs(lam))
        assert abs(e @ f) <= 1e-14 * float(scale)
        assert_dirac(skew, constraint)
        for kind in bundle.charges:
            terms = np.abs(skew) @ drawn + np.abs(constraint.T) @ np.abs(lam)
            assert abs(bundle.indicator(kind) @ f) <= 1e-13 * max(float(terms.sum()), 1e-300)
    elif primitive.kind == "irreversible":
        f = primitive.flow(x, e, reference)
        terms = np.abs(primitive.matrix(x, e, reference)) @ np.abs(e) / reference.temperature
        assert e @ f >= -1e-13 * (np.abs(e) @ terms)
        assert abs((e + intensive) @ f) <= 1e-12 * max(np.abs(e + intensive) @ terms, 1e-300)
        produced = -bundle.indicator("entropy") @ f
        assert produced >= -1e-13 * terms.sum()
        # Gouy and Stodola: the exergy destroyed is θ₀ times the entropy produced, less π₀ times the volume made
        destroyed = reference.temperature * produced
        assert abs(e @ f - destroyed) <= 1e-12 * (np.abs(e) @ terms + abs(destroyed) + (np.abs(intensive) @ terms))
    else:
        v = 0.1 * rng.standard_normal(bundle.size)
        gradient = primitive.discrete_effort(x, v, reference) + (0.0 if primitive.environment else intensive)
        rise = primitive.energy(primitive.retract(x, v)) - primitive.energy(x)
        scale = abs(primitive.energy(x)) + (np.abs(gradient) + np.abs(intensive)) @ np.abs(v)
        assert abs(rise - gradient @ v) <= 1e-13 * max(scale, 1e-300)
        back = primitive.discrete_effort(primitive.retract(x, v), -v, reference)
        here = primitive.discrete_effort(x, v, reference)
        assert largest(here - back) <= 1e-9 * max(1.0, largest(here))


@given(
    st.sampled_from(["momentum", "displacement", "entropy", "pose", "direct_pose", "body_momentum"]),
    st.data(),
    generators,
)
def test_the_conditions_hold_of_drawn_storages(kind, data, rng):
    interface = library.power_ports(x=getattr(Q, kind))
    _conditions(data.draw(storages(interface)), rng)


@pytest.mark.parametrize(("name", "state", "energy", "effort"), [
    ("spring", 2.0, 3.0, 3.0), ("point_mass", 2.0, 1.0, 1.0), ("rotor", 2.0, 20.0, 20.0),
    ("capacitor", 0.3, 0.15, 1.0), ("inductor", 0.4, 0.2, 1.0), ("reluctance", 2.0, 8.0, 8.0),
    ("inertance", 2.0, 1e-5, 1e-5), ("thermal_capacity", 0.0, 0.0, 300.0 - 293.15),
])  # fmt: skip
def test_energies_of_the_storages(name, state, energy, effort):
    storage = made(name)
    x = {port: np.array([state]) for port in storage.bundle.ports}
    assert storage.energy(x) == pytest.approx(energy)
    assert storage.effort(x, Reference())[0] == pytest.approx(effort)


# ---- what is refused -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "arguments", "key"),
    [("spring", {"k": 0.0}, "k"), ("spring", {"k": np.nan}, "k"), ("point_mass", {"m": -1.0}, "m"),
     ("friction", {"d": -0.1}, "d"), ("capacitor", {"c": np.inf}, "c"), ("piston", {"a": 0.0}, "a"),
     ("thermal_capacity", {"c1": -1.0, "c2": 1.0}, "c1"), ("lever", {"r": np.nan}, "r"),
     ("heat_transfer", {"h": -1.0}, "h")],
)  # fmt: skip
def test_parameters_out_of_range_are_named(name, arguments, key):
    with pytest.raises(StructureError, match=f"{name}: parameter {key} is"):
        getattr(library, name)(**arguments)


def test_what_one_makes_oneself_is_what_the_library_makes():
    mine = {
        "spring": ephs.storage({"q": Q.displacement}, lambda q: 0.75 * q * q, lambda q: [1.5 * q]),
        "pkc": ephs.gyrator(QP, [[0.0, -1.0], [1.0, 0.0]]),
        "lever": ephs.transformer({"q1": Q.displacement, "q2": Q.displacement}, [[2.5]]),
        "rigid_link": ephs.constraint({"p": Q.momentum, "p2": Q.momentum}, [[1.0, -1.0]]),
        "friction": drag(lambda p, s: 0.2)(),
    }
    for name, primitive in mine.items():
        state = {str(port): 0.4 for port in primitive.reads}
        from ephs.semantics.systems.system import as_system

        ours = as_system(made(name)).relation().at(state)
        theirs = as_system(primitive).relation().at(state)
        assert ours.distance(theirs) <= 1e-12, name


def test_structures_that_read_states():
    crank = ephs.transformer({"p": Q.angular_momentum, "p2": Q.momentum, "~q": Q.angle}, lambda q: [[np.sin(q)]])
    _, constraint = crank.structure({Path.of("q"): np.array([0.3])})
    assert np.allclose(constraint, [[-np.sin(0.3), 1.0]])
    spool = ephs.constraint({"p": Q.momentum, "p2": Q.momentum, "~q": Q.displacement}, lambda q: [[1.0, q]])
    assert spool.multipliers == 1  # counted at a random state
    assert np.allclose(spool.structure({Path.of("q"): np.array([0.3])})[1], [[1.0, 0.3]])
    with pytest.raises(StructureError, match=r"is \(1, 2\)|shape \(2, 2\)"):
        ephs.constraint({"p": Q.momentum, "p2": Q.momentum, "~q": Q.displacement}, lambda q: [[1.0, q]], multipliers=2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: ephs.storage({"q": Q.displacement}, lambda x: x**2),
            r"energy is a function of \(x\).*of \(q\)",
        ),
        (lambda: ephs.storage({"q": Q.displacement}, 3.0), "energy is 3.0, expected a function"),
        (
            lambda: ephs.storage({"q": Q.displacement}, lambda q: q**2, lambda q: [q, q]),
            r"gradient is \(2,\)",
        ),
        (lambda: ephs.storage({"q": Q.displacement}, lambda q: float("nan")), "energy is nan.*finite"),
        (lambda: ephs.gyrator({"~q": Q.displacement}, [[0.0]]), "ports is ~q, expected a power port"),
        (lambda: ephs.gyrator({"q": Q.displacement, "~q": Q.displacement}, [[0.0]]), "q twice"),
        (lambda: ephs.transformer({"q": Q.displacement}, [[1.0]]), "two power ports"),
        (lambda: ephs.constraint({"p": Q.momentum}, [1.0, 2.0]), r"shape \(1, 1\)"),
        (lambda: ephs.constraint({"p": Q.momentum}, "abc"), "matrix is"),
        (lambda: ephs.irreversible({"p": Q.momentum, "s": Q.entropy}, [[1.0]]), "expected a function"),
    ],
)
def test_functions_and_ports_that_do_not_fit_are_named(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_scales_far_from_one_are_accepted():
    """Capacities, volumes and charges of a microscopic device."""
    library.thermal_capacity(c1=1.0, c2=1e-4)
    gas = library.ideal_gas(c1=1e-3, c2=1e-5, v0=1e-9, c=1.5)
    x, v = {Path.of("s"): np.array([0.0]), Path.of("v"): np.array([1e-9])}, np.array([1e-7, 2e-12])
    gradient = gas.discrete_effort(x, v, Reference()) + gas.bundle.intensive(Reference())
    rise = gas.energy(gas.retract(x, v)) - gas.energy(x)
    assert abs(gradient @ v - rise) <= 1e-14 * gas.energy(x)
    # also where increments are so small that their squares vanish beside one
    mine = ephs.storage({"v": Q.volume}, lambda v: 1e-9 / v)
    x, v = {Path.of("v"): np.array([1e-9])}, np.array([1e-11])
    gradient = mine.discrete_effort(x, v, Reference()) + mine.bundle.intensive(Reference())
    rise = mine.energy(mine.retract(x, v)) - mine.energy(x)
    assert abs(gradient @ v - rise) <= 1e-14


@given(interfaces(max_ports=4))
def test_a_bundle_lays_its_ports_side_by_side(interface):
    bundle = Bundle.of(interface)
    places = [i for _, where, _ in bundle.items() for i in range(where.start, where.stop)]
    assert places == list(range(bundle.size))
    assert {port for port, _, _ in bundle.items()} == {port for port, t in interface.items() if t.power}
