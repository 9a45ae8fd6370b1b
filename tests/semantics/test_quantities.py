"""Quantities of one's own: their domains, the charges that they carry, the reference environment's potentials."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs import AssemblyError, Pattern, StructureError, System, irreversible, junction, simulate, storage
from ephs.operad import Quantity, Space
from ephs.operad import quantity as Q
from ephs.semantics import Reference, library
from ephs.semantics.bundles.bundle import Bundle
from ephs.semantics.bundles.extents import expected, inside
from ephs.semantics.primitives.primitives import power_ports
from ephs.semantics.verdicts.checks import random_point
from tests.numerics import EPS, largest

ONE = Space("real", 1, 1)
ROUNDING = EPS
WHOLE = st.integers(-2, 3)
RARE = Quantity("share", ONE, 1, domain=(0.0, 1.0), charges={"H": 1.0}, unit="mol")


def reaction(nu, species):
    """An irreversible process of rate one along ν: M = n nᵀ with n = (θ ν, −⟨ν|μ⟩)."""
    ports = {f"n{i}": q for i, q in enumerate(species)} | {"s": Q.entropy}

    def matrix(s, **mu):
        normal = [s * k for k in nu] + [-sum(k * mu[f"n{i}"] for i, k in enumerate(nu))]
        return np.outer(normal, normal)

    return irreversible(
        ports, eval(f"lambda {', '.join(ports)}: matrix({', '.join(f'{p}={p}' for p in ports)})", {"matrix": matrix})
    )


@settings(max_examples=25)
@given(st.lists(st.tuples(WHOLE, WHOLE), min_size=2, max_size=3), st.data())
def test_a_reaction_is_taken_where_it_keeps_the_elements_and_nowhere_else(atoms, data):
    nu = data.draw(st.tuples(*[WHOLE] * len(atoms)).filter(any))
    assume(all(any(row) for row in atoms))
    species = [Quantity(f"n{i}", ONE, 1, charges={"H": h, "O": o}) for i, (h, o) in enumerate(atoms)]
    if not np.any(np.array(nu) @ np.array(atoms)):
        process = reaction(nu, species)
        rng = np.random.default_rng(0)
        reference = Reference(300.0, potentials={"H": 5e3, "O": -2e4})
        e = np.append(1e3 * rng.standard_normal(len(nu)), 20.0)
        f = process.flow({}, e, reference)
        # Gouy and Stodola: what is destroyed is θ₀ times the entropy that is made, whatever the potentials
        terms = np.abs(e) @ np.abs(process.matrix({}, e, reference)) @ np.abs(e) / reference.temperature
        assert abs(e @ f + reference.temperature * f[-1]) <= 8 * e.size**2 * ROUNDING * terms
    else:
        with pytest.raises(StructureError, match=r"[HO] is not conserved"):
            reaction(nu, species)


def test_total_moles_are_free_where_atoms_are_kept():
    one, two = Q.species("A", A=1), Q.species("A2", A=2)
    assert reaction((-2, 1), [one, two]).kind == "irreversible"
    assert reaction((-2, 1), [Q.amount, Q.amount]).kind == "irreversible"  # of nothing in particular
    with pytest.raises(StructureError, match="A is not conserved"):
        reaction((-1, 1), [one, two])


@pytest.mark.parametrize(
    "q",
    [
        Q.volume,
        RARE,
        Quantity("debt", ONE, 1, domain=(-math.inf, -2.0)),
        Quantity("k", Space("real", 3, 3), 1, domain=(2.0, 3.0)),
        Q.momentum,
    ],
    ids=lambda q: q.kind,
)
def test_random_states_lie_in_the_domain(q):
    rng = np.random.default_rng(3)
    bundle = Bundle.of(power_ports(x=q))
    found = np.array([random_point(bundle, bundle.ports, rng)[bundle.ports[0]] for _ in range(200)])
    low, high = q.domain
    assert np.all((found > low) & (found < high)) and np.ptp(found) > 0.1 * min(high - low, 1.0)
    assert inside(q, found[0])
    for end in (low, high):
        assert not inside(q, np.full(q.space.dim, end))  # the interval is open


def test_an_energy_is_asked_inside_of_its_domain_only():
    def mixing(s, n):
        return 100.0 * math.exp(s / 20.0) + 50.0 * (n * math.log(n) + (1.0 - n) * math.log(1.0 - n))

    assert storage({"s": Q.entropy, "n": RARE}, mixing).kernel is not None
    with pytest.raises(StructureError, match=r"the energy has no value .*n = .*declare a domain"):
        storage({"s": Q.entropy, "n": Quantity("share", ONE, 1)}, mixing)
    with pytest.raises(StructureError, match=r"the matrix has no value .*p=.*declare the domain"):
        irreversible({"p": Q.momentum, "s": Q.entropy}, lambda p, s: math.log(-abs(float(p))) * np.eye(2))


@pytest.mark.parametrize(("q", "words"), [(RARE, "a number between 0 and 1"), (Q.species("A"), "a number > 0")])
def test_an_initial_value_lies_in_the_domain(q, words):
    assert expected(q) == words
    system = Pattern({"n": junction(q)}, {"a": {"n": "n"}})(a=storage({"n": q}, lambda n: n**2))
    with pytest.raises(AssemblyError, match=words):
        simulate(system, 1.0)
    assert simulate(system, 1.0, initial={"a.n": 0.5}, step=0.5)["a.n"][-1] == 0.5


def vessel(language):
    """2A ⇌ B, with an energy that can be traced, or one that has to be called back."""

    def plain(s, a, b):
        return 100.0 * math.exp((s + 8.0 * (a * math.log(a) + b * math.log(b))) / 20.0)

    def opaque(s, a, b):
        return plain(float(s), float(a), float(b))

    def matrix(a, b, s):
        normal = [-2.0 * s, s, 2.0 * a - b]
        return 1e-6 * np.outer(normal, normal)

    one, two = Q.species("A", X=1), Q.species("B", X=2)
    pattern = Pattern.from_text("a: species(A, X=1); b: species(B, X=2); s: entropy; mix(s, a, b); r(a, b, s)")
    mix = storage({"s": Q.entropy, "a": one, "b": two}, plain if language == "traced" else opaque)
    return pattern(mix=mix, r=irreversible({"a": one, "b": two, "s": Q.entropy}, matrix))


INITIAL = {"mix.a": 1.0, "mix.b": 0.1, "mix.s": 50.0}


@pytest.mark.parametrize("language", ["traced", "called back"])
def test_reference_potentials_move_the_exergy_and_nothing_else(language):
    system, mu = vessel(language), 70.0
    bare, raised = (
        simulate(system, 0.2, initial=INITIAL, method="natural", step=0.05, reference=Reference(potentials=given))
        for given in ({}, {"X": mu})
    )
    for path in INITIAL:
        assert np.allclose(bare[path], raised[path], rtol=1e-11, atol=0.0)
    atoms = 1.0 + 2.0 * 0.1
    scale = ROUNDING * largest(bare.exergy)
    assert largest(bare.exergy - raised.exergy - mu * atoms) <= 100.0 * scale
    # exergy is destroyed as entropy is made
    lost, made = bare.exergy[0] - bare.exergy[-1], bare.entropy[-1] - bare.entropy[0]
    assert made > 0.0 and abs(lost - 293.15 * made) <= 1e-9 * abs(lost)
    account = system.ledger.total(INITIAL, Reference(potentials={"X": mu}))
    assert account.charges == {"X": pytest.approx(atoms, rel=4 * ROUNDING)} and account.volume == 0.0
    assert system.ledger.total(INITIAL).exergy - account.exergy == pytest.approx(mu * atoms, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [({"entropy": 1.0}, "temperature="), ({"volume": 1.0}, "pressure="), ({"H": math.inf}, "inf J, expected a finite")],
)
def test_wrong_potentials_are_refused(given, words):
    with pytest.raises(ValueError, match=words):
        Reference(potentials=given)


def test_a_reference_is_a_value():
    one, other = Reference(potentials={"H": 1.0, "O": 2.0}), Reference(potentials={"O": 2.0, "H": 1.0})
    assert one == other and hash(one) == hash(other) and one != Reference()
    both = Quantity("gases", Space("real", 2, 2), 1, charges={"H": (2, 0), "O": (1, 2)})
    assert one.intensive(both).tolist() == [4.0, 4.0]
    assert one.intensive(Q.volume).tolist() == [-one.pressure] and one.intensive(Q.entropy).tolist() == [
        one.temperature
    ]
    assert Bundle.of(power_ports(n=both, v=Q.volume)).charges == ("H", "O", "volume")
    assert library.environment().environment


@given(st.lists(st.sampled_from((Q.volume, Q.pose, Q.charge)), min_size=2, max_size=6))
def test_junctions_of_a_system_have_their_own_quantities_whatever_their_frames(kinds):
    junctions = {f"j{i}": junction(of.in_frame("B")) for i, of in enumerate(kinds)}
    pattern = Pattern(junctions, {f"b{i}": {"x": f"j{i}"} for i in range(len(kinds))})
    system = System.of(pattern, {f"b{i}": library.environment(x=of.in_frame("B")) for i, of in enumerate(kinds)})
    d = system.descriptor()
    assert [slot.quantity for slot in d.junctions] == kinds
    assert [slot.quantity.in_frame(None) for slot in d.states] == kinds
