"""Storages carry their initial states, systems collect them, and nothing that keeps a storage loses them."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import AssemblyError, Pattern, System, library
from ephs import quantity as Q
from ephs.semantics import Storage
from ephs.semantics.systems.initial import read_state
from ephs.semantics.verdicts.checks import random_point
from ephs.testing import systems
from tests.numerics import EPS, largest
from tests.semantics.test_documents import MECHANICS, VALID

ROUNDING = 8 * 7 * EPS
"""Of a quaternion that is normalised, and what goes with it."""


def started(system, seed):
    """Values of about half of the states, in their domains; the system that carries them."""
    rng = np.random.default_rng(seed)
    values = {
        path / port: x
        for path, part in system.leaves()
        if isinstance(part, Storage)
        for port, x in random_point(part.bundle, part.reads, rng).items()
        if rng.random() < 0.5
    }
    return values, system.with_initial(values)


def assert_starts(system, values):
    assert system.initial.keys() == values.keys()
    state = system.state()
    for path, value in values.items():
        assert largest(system.initial[path] - value) <= ROUNDING * largest(value)
        assert np.array_equal(state[path], system.initial[path])


@settings(max_examples=10)
@given(systems(max_depth=3), st.integers(0, 99))
def test_systems_collect_what_their_storages_carry(system, seed):
    values, made = started(system, seed)
    assert_starts(made, values)
    assert_starts(made.flatten(), values)
    assert_starts(made.flatten_once(), values)
    assert (made == system) == (not values)
    for path, value in system.state().items():
        assert np.array_equal(value, made.state({str(path): value})[path])  # what is given comes first


@pytest.mark.parametrize("number", range(len(MECHANICS)))
def test_documents_keep_them(number):
    values, made = started(MECHANICS[number], number)
    document = json.loads(made.to_json())
    VALID.validate(document)
    again = System.from_dict(document)
    assert again == made
    assert_starts(again, made.initial)
    assert values.keys() <= made.initial.keys()


@pytest.mark.parametrize("space", ["SE(3)", "SO(3)"])
def test_a_state_that_was_read_is_read_as_it_is(space):
    """Dividing a quaternion by its length twice changes last digits; what is far from unit length is divided."""
    rng, of = np.random.default_rng(0), Q.pose if space == "SE(3)" else Q.relative_pose("spherical")
    for _ in range(200):
        once = read_state(ephs.Path.of("q"), of, rng.standard_normal(of.space.size))
        assert np.array_equal(read_state(ephs.Path.of("q"), of, once), once)
        assert abs(np.linalg.norm(once[:4]) - 1.0) <= 4e-16


def oscillator(**parts):
    return Pattern.from_text("q: displacement; p: momentum; spring(q); mass(p); pkc(q, p)")(
        **{"spring": library.spring(k=2.0), "mass": library.point_mass(m=1.0), "pkc": library.pkc()} | parts
    )


def quartic(**more):
    return ephs.storage({"q": Q.displacement}, lambda q: 0.25 * q**4, **more)


def test_a_run_begins_where_its_components_say_and_single_values_are_overridden():
    system = oscillator(spring=quartic(initial={"q": 2.0}), mass=library.point_mass(m=1.0).with_initial({"p": 0.5}))
    sol = ephs.simulate(system, 0.5, step=0.01)
    same = ephs.simulate(oscillator(spring=quartic()), 0.5, initial={"spring.q": 2.0, "mass.p": 0.5}, step=0.01)
    assert np.array_equal(sol["spring.q"], same["spring.q"]) and sol["spring.q"][0] == 2.0
    one = ephs.simulate(system, 0.5, initial={"spring.q": -1.0}, step=0.01)
    assert (one["spring.q"][0], one["mass.p"][0]) == (-1.0, 0.5)


def test_a_run_goes_on_from_its_end():
    system = oscillator(spring=quartic(initial={"q": 2.0}))
    whole = ephs.simulate(system, 1.0, method="rk54", step=0.01)
    half = ephs.simulate(system, 0.5, method="rk54", step=0.01)
    rest = ephs.simulate(system.at(half, 0.5), 1.0, t0=0.5, method="rk54", step=0.01)
    assert largest(rest["spring.q"] - whole["spring.q"][50:]) <= 8 * 400 * EPS * 2.0
    with pytest.raises(AssemblyError, match=r"no state at 0\.7 s; it has times from 0\.0 to 0\.5 s"):
        system.at(half, 0.7)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: quartic(initial={"x": 1.0}), "x: no such state; the states are q"),
        (lambda: quartic(initial={"q": [1.0, 2.0]}), r"q: the initial value has shape \(2,\), expected \(1,\)"),
        (lambda: quartic(initial={"q": np.nan}), "q: the initial value is .*nan.*, expected finite numbers"),
        (lambda: oscillator().with_initial({"spring.p": 1.0}), "spring.p: no such state; the states are"),
        (lambda: oscillator().with_initial({"mass.p": "much"}), "mass.p: the initial value is much"),
    ],
)
def test_what_is_no_initial_state_is_refused(make, said):
    with pytest.raises(AssemblyError, match=said):
        make()


def test_documents_with_an_initial_state_that_does_not_fit_are_refused():
    document = oscillator(spring=quartic(initial={"q": 2.0})).to_dict()
    parts = {part.get("part", part.get("storage")): part for part in document["parts"] if "ports" in part}
    parts["storage"]["initial"] = {"q": [1.0, 2.0]}
    with pytest.raises(ephs.PatternError, match=r"initial: .*\(2,\)"):
        System.from_dict(document)
    del parts["storage"]["initial"]
    parts["pkc"]["initial"] = {"q": [1.0]}
    with pytest.raises(ephs.PatternError, match="none: it has no states"):
        System.from_dict(document)
