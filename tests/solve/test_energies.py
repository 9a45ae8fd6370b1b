"""Equations by energies of stores of heat: they are those by states, and conduction is one matrix."""

import numpy as np
import pytest

import ephs
from benchmarks.cells import conducting
from ephs import Pattern, Reference, library
from ephs.operad import quantity as Q
from ephs.semantics.descriptor.descriptor import Input, descriptor_of
from ephs.semantics.verdicts.conduction import conductances
from ephs.solve.equations.model import compile_model
from ephs.solve.methods.continuous import Continuous
from ephs.solve.methods.energies import EnergyEquations
from ephs.solve.methods.integral import Integral
from ephs.solve.methods.stores import HeatStores
from examples import physics
from tests.numerics import EPS, largest, slope

ROUNDING = EPS


def radiation(a, b):
    """Heat by the difference of fourth powers."""
    k = 1e-8 * (a + b) * (a**2 + b**2)
    return [[k * b / a, -k], [-k, k * a / b]]


def three(a, b, c):
    """Each pair of three temperatures conducts, 1, 2 and 3 W/K."""
    return [
        [(b + 2.0 * c) / a, -1.0, -2.0],
        [-1.0, (a + 3.0 * c) / b, -3.0],
        [-2.0, -3.0, (2.0 * a + 3.0 * b) / c],
    ]


RADIATING = ephs.irreversible({"a": Q.entropy, "b": Q.entropy}, radiation)
THREE = ephs.irreversible({"a": Q.entropy, "b": Q.entropy, "c": Q.entropy}, three)


@pytest.mark.parametrize("process", [library.heat_transfer(h=0.7), library.heat_transfer(h=0.0), THREE])
def test_powers_of_conduction_are_its_matrix_times_temperatures(process):
    k, reference = conductances(process), Reference()
    assert k is not None and np.array_equal(k, k.T) and np.all(k.sum(axis=0) == 0.0)
    rng = np.random.default_rng(3)
    for theta in rng.uniform(100.0, 900.0, (5, len(k))):
        flow = process.flow({}, theta - reference.temperature, reference)
        terms = 8 * len(k) * ROUNDING * (np.abs(k) @ theta) * (1.0 + theta / reference.temperature)
        assert np.all(np.abs(theta * flow - k @ theta) <= terms)


@pytest.mark.parametrize("other", [RADIATING, library.friction(d=0.1), library.resistor(r=2.0)])
def test_other_processes_have_no_such_matrix(other):
    assert conductances(other) is None


def mixed():
    """Stores that conduct to each other and to the environment; one of them radiates, one has friction beside it."""
    pattern = Pattern.from_text(
        "a: entropy; b: entropy; c: entropy; e: entropy; p: momentum; q: displacement;"
        "one(s=a); two(s=b); three(s=c); env(s=e); link(s1=a, s2=b); out(s1=b, s2=e); shine(a=b, b=c);"
        "mass(p); spring(q); pkc(q, p); rub(p, s=c)"
    )
    return pattern(
        one=library.thermal_capacity(c1=293.15 * 3.0, c2=3.0), two=library.thermal_capacity(c1=280.0, c2=0.9),
        three=library.thermal_capacity(capacity=2.0, temperature=310.0), env=library.environment(),
        link=library.heat_transfer(h=0.7), out=library.heat_transfer(h=0.2), shine=RADIATING,
        mass=library.point_mass(m=1.0), spring=library.spring(k=2.0), pkc=library.pkc(), rub=library.friction(d=0.3),
    )  # fmt: skip


SYSTEMS = {"mixed": mixed(), "wall": conducting(1, 5), "motor": physics.motor, "cylinder": physics.cylinder}


def compiled(system):
    """The model, an effort given at its first outer port and flows at the others, and the values there."""
    ports = [(path, port.quantity.space.dim) for path, port in system.interface.items() if port.power]
    given = {path: Input(np.full(dim, 0.3), i == 0) for i, (path, dim) in enumerate(ports)}
    model = compile_model(descriptor_of(system.flatten()), Reference(), given)
    return model, model.input_values()


def state(model, seed):
    """States at which volumes are positive."""
    x = model.descriptor.pack(model.descriptor.system.state())
    return x + 0.3 + 0.05 * np.random.default_rng(seed).standard_normal(x.size)


@pytest.mark.parametrize("name", SYSTEMS)
def test_rates_of_energies_are_temperatures_times_those_of_entropies(name):
    model, inputs = compiled(SYSTEMS[name])
    stores = HeatStores(model)
    own, x = EnergyEquations(model, stores), state(model, 1)
    y = stores.numbers(x)
    slopes = stores.slopes(y)
    assert stores.warm.size and np.all(slopes[stores.warm] != 1.0)
    assert largest(stores.entropies(y) - x) <= 64 * ROUNDING
    plain = Integral.of(model)
    assert plain is not None
    found = -own.residuals(y[None], np.zeros((1, y.size)), inputs[None])[0]
    expected = slopes * plain.rates(x[None], inputs[None])[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * largest(expected))


@pytest.mark.parametrize("general", [False, True])
@pytest.mark.parametrize("name", SYSTEMS)
def test_derivatives_by_energies_are_those_of_the_equations(name, general):
    """Of the general equations, too, where rates of entropies are unknowns."""
    model, inputs = compiled(SYSTEMS[name])
    stores = HeatStores(model)
    own = EnergyEquations(model, stores)
    if general:
        own.within, own.conduction, own.linear = Continuous(model), None, False
    y = stores.numbers(state(model, 2))
    z = own.within.guess(stores.entropies(y))
    z[: y.size] = np.random.default_rng(4).standard_normal(y.size) * stores.slopes(y)
    matrices = own.matrices(y, z, inputs)
    for at, columns in ((y, matrices.states), (z, matrices.unknowns)):
        for j, unit in enumerate(np.eye(y.size, at.size)):
            h = 1e-5 * max(abs(at[j]), 1e-2)

            def residuals(d, at=at, unit=unit):
                pair = (at + d * unit, z) if at is y else (y, at + d * unit)
                return own.residuals(pair[0][None], pair[1][None], inputs[None])[0]

            assert largest(slope(residuals, h) - columns[:, j]) <= 1e-6 * max(largest(columns), 1.0)


def run(system, **options):
    return ephs.simulate(system, 50.0, initial={"n0_0.s": 5.0}, method="radau", **options)


def test_steps_of_conduction_alone_need_one_iteration_and_keep_the_energy():
    sol = run(conducting(3, 4), rtol=1e-6)
    assert sol.stats["iterations"] == sol.stats["steps"] + sol.stats["rejected"]
    assert sol.energy_error.max() <= 64 * ROUNDING and sol.stats["least_production"] >= -1e-12
    pattern = Pattern.from_text("s0: entropy; s1: entropy; n0_0(s=s0); other(s=s1); link(a=s0, b=s1)")
    node = library.thermal_capacity(c1=293.15 * 10.0, c2=10.0)
    control = run(pattern(n0_0=node, other=node, link=RADIATING), rtol=1e-6)
    assert control.stats["iterations"] > control.stats["steps"]
