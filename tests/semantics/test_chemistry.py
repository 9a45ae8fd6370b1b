"""Ideal mixtures and mass action, against closed forms."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs import Pattern, Reference, StructureError, junction, simulate
from ephs import library as lib
from ephs.operad import Path
from ephs.operad import quantity as Q
from ephs.semantics.library import chemistry
from ephs.semantics.library.chemistry import Species
from ephs.semantics.systems.report import check_system
from tests.numerics import EPS, largest

R = 8.31446261815324

GASES = (
    Species("A", {"X": 1}, energy=1e3, entropy=10.0, capacity=20.0),
    Species("B", {"X": 2}, energy=-2e3, entropy=15.0, capacity=45.0),
    Species("C", {"Y": 1}, energy=500.0, entropy=3.0, capacity=12.5),
)
AMOUNTS = st.floats(1e-3, 5.0)
PHASES = pytest.mark.parametrize("phase", ["gas", "solution"])


def at(mixture, **values):
    return {port: np.array([values[str(port)]]) for port in mixture.bundle.ports}


@cache
def mixture_of(phase):
    return lib.ideal_mixture(species=GASES, phase=phase)


@cache
def reaction_of(equation, phase, **constants):
    """Of the gases: its structure is searched for counterexamples once, not once an example."""
    return lib.reaction(equation, species=GASES, phase=phase, **constants)


@PHASES
@given(st.floats(250.0, 600.0), st.floats(1e-2, 2.0), st.tuples(AMOUNTS, AMOUNTS, AMOUNTS))
def test_a_mixture_is_that_of_its_equations_of_state(phase, temperature, volume, amounts):
    """θ as the entropy was made for, π v = n R θ, μ = μ°(θ) + R θ ln a, and Euler's relation."""
    mixture = mixture_of(phase)
    n = dict(zip("ABC", amounts, strict=True))
    s = chemistry.mixture_entropy(GASES, temperature=temperature, volume=volume, amounts=n, phase=phase)
    x = at(mixture, s=s, v=volume, **n)
    found = dict(zip(map(str, mixture.bundle.ports), mixture.energy_gradient(x), strict=True))
    # the exponent s/C amplifies its rounding
    total, capacity = sum(amounts), sum(n[g.name] * g.capacity for g in GASES)
    size = (abs(s) + sum(k * (g.entropy + 250.0) for k, g in zip(amounts, GASES, strict=True))) / capacity
    exact = 64 * EPS * (1.0 + size)
    assert found["s"] == pytest.approx(temperature, rel=exact)
    if phase == "gas":
        assert -found["v"] == pytest.approx(total * R * temperature / volume, rel=2 * exact)
    for gas in GASES:
        share = n[gas.name] / (volume * gas.pressure / (R * gas.temperature)) if phase == "gas" else n[gas.name] / total
        warm = gas.energy + gas.capacity * (temperature - gas.temperature) + R * temperature * (phase == "gas")
        cold = temperature * (gas.entropy + gas.capacity * math.log(temperature / gas.temperature))
        scale = abs(warm) + abs(cold) + R * temperature * (10.0 + abs(math.log(share))) + temperature * gas.capacity
        expected = warm - cold + R * temperature * math.log(share)
        assert found[gas.name] == pytest.approx(expected, abs=exact * scale)
    terms = [found[str(port)] * float(x[port][0]) for port in mixture.bundle.ports]
    assert mixture.energy(x) == pytest.approx(sum(terms), abs=exact * sum(map(abs, terms)))


@PHASES
@given(st.floats(250.0, 600.0), st.tuples(AMOUNTS, AMOUNTS, AMOUNTS))
def test_a_rate_is_that_of_mass_action(phase, temperature, amounts):
    """Of 2 A + C = B + C, at a mixture's potentials: atoms to rounding, entropy not destroyed."""
    volume, k, activation = 0.3, 2e-3, 1e3
    equation = "2 A + C = B + C"
    process = reaction_of(equation, phase, k=k, activation=activation)
    n = dict(zip("ABC", amounts, strict=True))
    s = chemistry.mixture_entropy(GASES, temperature=temperature, volume=volume, amounts=n, phase=phase)
    mixture = mixture_of(phase)
    efforts = dict(
        zip(map(str, mixture.bundle.ports), mixture.energy_gradient(at(mixture, s=s, v=volume, **n)), strict=True)
    )
    reference = Reference(300.0, potentials={"X": 400.0, "Y": -70.0})
    energy = np.array([efforts[str(port)] for port in process.bundle.ports])
    f = process.flow(
        {port: np.array([volume]) for port in process.reads}, energy - process.bundle.intensive(reference), reference
    )
    flow = dict(zip(map(str, process.bundle.ports), f, strict=True))
    of = [a / volume for a in amounts] if phase == "gas" else [a / sum(amounts) for a in amounts]
    constant = chemistry.equilibrium_constant(equation, species=GASES, temperature=temperature, phase=phase)
    speed = k * math.exp(-activation / (R * temperature)) * (volume if phase == "gas" else 1.0)
    forward, backward = speed * of[0] ** 2 * of[2], speed * of[1] * of[2] / constant
    # logarithms of rates are potentials of some 1e4 J/mol over R θ; what they lose is amplified by nothing else
    exact = 1e3 * EPS * (forward + backward)
    assert flow["A"] == pytest.approx(2.0 * (forward - backward), abs=2 * exact)
    assert flow["B"] == pytest.approx(backward - forward, abs=exact)
    assert abs(flow["C"]) == 0.0 and abs(flow["A"] + 2.0 * flow["B"]) <= 8 * EPS * abs(flow["A"])
    assert -flow["s"] >= 0.0
    heat = efforts["s"] * flow["s"] + efforts["A"] * flow["A"] + efforts["B"] * flow["B"]
    assert abs(heat) <= 64 * EPS * (abs(efforts["A"] * flow["A"]) + abs(efforts["B"] * flow["B"]))


def test_the_constant_is_that_of_the_standard_potentials():
    mild = {"energy": 0.0, "capacity": 20.0}
    a, b = (
        Species("A", {"X": 1}, entropy=R, **mild),
        Species("B", {"X": 2}, entropy=R + 7.0, **(mild | {"capacity": 40.0})),
    )
    # at the standard temperature μ° = R θ − θ σ: 0 of A, −7 θ of B, in concentrations p°/(R θ)
    found = chemistry.equilibrium_constant("2 A = B", species=(a, b), temperature=298.15)
    assert found == pytest.approx(math.exp(7.0 / R) / (1e5 / (R * 298.15)), rel=1e-13)
    pure = chemistry.equilibrium_constant("2A = B", species=(a, b), temperature=298.15, phase="solution")
    assert pure == pytest.approx(math.exp((7.0 - R) / R), rel=1e-13)


def vessel(species, equation="2 A = B", phase="gas", **constants):
    """A closed vessel with a mixture, in which a reaction goes on."""
    names = [one.name for one in species]
    junctions = {"s": junction(Q.entropy)} | ({"v": junction(Q.volume)} if phase == "gas" else {})
    junctions |= {one.name: junction(one.quantity) for one in species}
    process = lib.reaction(equation, species=species, phase=phase, **constants)
    ports = {str(p): str(p) if t.power else f"~{p}" for p, t in process.interface.items()}
    pattern = Pattern(junctions, {"mixture": {name: name for name in junctions}, "reaction": ports})
    assert set(names) < set(junctions)
    return pattern(mixture=lib.ideal_mixture(species=species, phase=phase), reaction=process)


def start(species, temperature, volume, phase="gas", **amounts):
    s = chemistry.mixture_entropy(species, temperature=temperature, volume=volume, amounts=amounts, phase=phase)
    return {
        f"mixture.{name}": value
        for name, value in ({"s": s} | ({"v": volume} if phase == "gas" else {}) | amounts).items()
    }


def looked_at(sol, constant_of_temperature, mixture, volume=None):
    """Of a run: atoms, entropy in every step; and at its end the quotient of the reaction over its constant, and θ."""
    a, b = sol["mixture.A"], sol["mixture.B"]
    atoms = a + 2.0 * b
    assert largest(atoms - atoms[0]) <= 8 * EPS * len(atoms) * atoms[0]
    made = np.diff(sol["mixture.s"])
    moving = np.abs(np.diff(a)) > 1e-6 * atoms[0]
    assert made[moving].min() > 0.0 and made.min() >= -8 * EPS * abs(sol["mixture.s"][-1])
    assert largest(sol.energy - sol.energy[0]) <= 1e-12 * largest(sol.energy) * len(atoms)
    x = {port: np.array([sol[f"mixture.{port}"][-1]]) for port in mixture.bundle.ports}
    temperature = float(mixture.energy_gradient(x)[mixture.bundle.ports.index(Path.of("s"))])
    size = volume or a[-1] + b[-1]
    return (b[-1] / size) / (a[-1] / size) ** 2 / constant_of_temperature(temperature), temperature


@PHASES
def test_a_dimer_with_heat_comes_to_mass_action_where_it_gets_to(phase):
    volume = 0.02
    species = (
        Species("A", {"X": 1}, entropy=R, capacity=20.0),
        Species("B", {"X": 2}, energy=-4e3, entropy=30.0, capacity=45.0),
    )
    k = 5e-3 if phase == "gas" else 0.5
    sol = simulate(
        vessel(species, phase=phase, k=k, activation=1e3), 600.0,
        initial=start(species, 350.0, volume, phase, A=1.0, B=0.1), method="natural", step=1.0,
        audit="off",
    )  # fmt: skip

    def constant(temperature):
        return chemistry.equilibrium_constant("2 A = B", species=species, temperature=temperature, phase=phase)

    mixture = lib.ideal_mixture(species=species, phase=phase)
    quotient, temperature = looked_at(sol, constant, mixture, volume if phase == "gas" else None)
    assert quotient == pytest.approx(1.0, rel=1e-10) and temperature > 351.0
    # the energy stays: 20 a (θ − θ*) + b (−4e3 + 45 (θ − θ*))
    a, b, warm = sol["mixture.A"][-1], sol["mixture.B"][-1], temperature - 298.15
    assert 20.0 * a * warm + b * (45.0 * warm - 4e3) == pytest.approx(
        20.0 * 51.85 + 0.1 * (45.0 * 51.85 - 4e3), rel=1e-10
    )


def test_all_laws_hold_of_a_vessel():
    species = (Species("A", {"X": 1}, entropy=R, capacity=20.0), Species("B", {"X": 2}, entropy=60.0, capacity=40.0))
    system = vessel(species, k=5e-3)
    initial = start(species, 300.0, 0.02, A=1.0, B=0.5)
    report = check_system(system, Reference(300.0, 50.0, {"X": 200.0}), state=initial, probes=1)
    assert report.ok, str(report)
    assert any("X is balanced" in item.detail or "volume is balanced" in item.detail for item in report.items)
    assert system.ledger.total(initial).charges == {"X": pytest.approx(2.0, rel=1e-15)}


@pytest.mark.parametrize(
    ("equation", "words"),
    [
        ("A = B", "does not conserve X: .1"), ("A + C = B", "conserve X|conserve Y"), ("2 A", "as '2 A = B'"),
        ("2 A = D", "of the species A, B, C"), ("0 A = B", "as '2 A = B'"), ("A = B = C", "as '2 A = B'"), ("", "as"),
    ],
)  # fmt: skip
def test_equations_that_lose_atoms_or_sense_are_refused(equation, words):
    with pytest.raises(StructureError, match=words):
        lib.reaction(equation, species=GASES, k=1.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: lib.reaction("2 A = B", species=GASES, k=-1.0), "k is -1"),
        (lambda: lib.reaction("2 A = B", species=GASES, k=1.0, activation=math.nan), "activation is nan"),
        (lambda: lib.ideal_mixture(species=()), "found|none"),
        (lambda: lib.ideal_mixture(species=GASES[:1] * 2), "A, A"),
        (lambda: Species("s"), "another name"),
        (lambda: Species("D", capacity=0.0), "capacity is 0"),
        (lambda: chemistry.mixture_entropy(GASES[:1], temperature=300.0, amounts={"A": 1.0}), "volume is nan"),
    ],
)
def test_wrong_chemistry_is_refused(make, words):
    with pytest.raises(StructureError, match=words):
        make()


def test_the_environment_is_in_equilibrium_with_itself():
    """Potentials of elements from those of water, oxygen and nitrogen; a reaction among them changes no exergy."""
    water, oxygen = Species("H2O", {"H": 2, "O": 1}), Species("O2", {"O": 2})
    hydrogen = Species("H2", {"H": 2})
    potentials = chemistry.element_potentials({water: -2.4e5, oxygen: -4e3})
    reference = Reference(potentials=potentials)
    assert reference.intensive(water.quantity)[0] == pytest.approx(-2.4e5, rel=1e-14)
    burnt = 2.0 * reference.intensive(water.quantity) - reference.intensive(oxygen.quantity)
    assert burnt[0] == pytest.approx(2.0 * reference.intensive(hydrogen.quantity)[0], rel=1e-14)
    supply = lib.environment(**{"O2": oxygen.quantity, "s": Q.entropy})
    assert supply.total_energy(at(supply, O2=2.0, s=1.0), reference) == pytest.approx(-8e3 + 293.15)
    assert not np.any(supply.effort(at(supply, O2=2.0, s=1.0), reference))
