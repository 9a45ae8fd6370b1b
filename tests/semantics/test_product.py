"""A system is the product of its independent parts: of systems side by side, and of what shares only efforts that
something prescribes."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ephs import Path, Pattern, System, irreversible, quantity
from ephs import library as lib
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics import Reference
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.descriptor.product import factors_of
from ephs.semantics.primitives.behaviour import ContinuousBehaviour
from ephs.semantics.spaces import manifold
from ephs.testing import systems
from tests.mechanics.drawn_scenes import drawn, toml
from tests.numerics import EPS, largest, seeds
from tests.written import scene_of_text

REFERENCE = Reference(293.15, 300.0)
COILS = Pattern.from_text(
    "b1: flux_linkage; b2: flux_linkage; s: entropy;coil1(b=b1); coil2(b=b2); wire1(b=b1, s); wire2(b=b2, s); room(s)"
)
WALLS = Pattern.from_text(
    "s1: entropy; s2: entropy; s: entropy, exposed; one(s=s1); two(s=s2); wall1(s1, s2=s); wall2(s1=s2, s2=s)"
)


def coils(room):
    """Two coils, whose wires heat one thing."""
    wires = {f"wire{i}": lib.resistor(r=float(i)) for i in (1, 2)}
    return COILS({f"coil{i}": lib.inductor(l=float(i)) for i in (1, 2)} | wires | {"room": room})


def walls():
    """Two bodies that give heat to what is at one outer port."""
    bodies = {name: lib.thermal_capacity(c1=300.0, c2=2.0) for name in ("one", "two")}
    return WALLS(bodies | {f"wall{i}": lib.heat_transfer(h=float(i)) for i in (1, 2)})


def watched():
    """Two coils in a room, whose entropy one of the wires reads."""
    pattern = Pattern.from_text(COILS.to_text().replace("wire2(b=b2, s)", "wire2(b=b2, s, x=~s)"))
    ports = {"b": quantity.flux_linkage, "s": quantity.entropy, "~x": quantity.entropy}
    wire = irreversible(ports, lambda b, s, x: (1.0 + x * x) * np.array([[s, -b], [-b, b * b / s]]))
    return pattern({**dict(coils(lib.environment()).fillings), Path.of("wire2"): wire})


def vented():
    """Two coils in a room, which exchanges volume with the outside, too."""
    pattern = Pattern.from_text(COILS.to_text().replace("room(s)", "v: volume, exposed; room(s, v)"))
    room = lib.environment(s=quantity.entropy, v=quantity.volume)
    return pattern({**dict(coils(lib.environment()).fillings), Path.of("room"): room})


def parts_of(system, *prescribed):
    return factors_of(system.descriptor(), frozenset(map(Path.of, prescribed)))


SHARED = {
    "the environment": (coils(lib.environment()), ()),
    "a prescribed temperature": (walls(), ("s",)),
    "the ground, of scene 9": (problem_of_scene(scene_of_text(toml(drawn(9)))).system, None),
    "the ground, of scene 33": (problem_of_scene(scene_of_text(toml(drawn(33)))).system, None),
}
"""Systems of two parts, and their outer ports with prescribed efforts; None for all that have any."""


@pytest.mark.parametrize("name", SHARED)
@given(seed=seeds)
def test_equations_of_a_system_are_those_of_its_parts(name, seed):
    system, prescribed = SHARED[name]
    assert_product(system, () if prescribed is None else prescribed, seed, 2)


@pytest.mark.parametrize(
    ("system", "prescribed"),
    [(coils(lib.thermal_capacity(c1=300.0, c2=2.0)), ()), (walls(), ()), (watched(), ()), (vented(), ())],
    ids=["what is heated by both", "a heat flow into both", "a room that is read", "a room with an outer port"],
)
def test_what_takes_part_joins_them(system, prescribed):
    """The control: nothing prescribes the effort of what they share."""
    assert len(parts_of(system, *prescribed)) == 1


@given(st.lists(systems(max_depth=2, isolated=True), min_size=2, max_size=3), seeds)
def test_parts_of_systems_side_by_side_are_those_of_each(each, seed):
    whole = System.of(Pattern({}, {f"x{i}": {} for i in range(len(each))}), {f"x{i}": s for i, s in enumerate(each)})
    own = [parts_of(one) for one in each]
    stored = [len(found) for found, one in zip(own, each, strict=True) if stores(one)]
    assume(len(stored) > 1)
    assert len(parts_of(whole)) == sum(stored)
    assert_product(whole, (), seed, sum(stored))


def stores(system):
    """Whether something but an environment does in it."""
    return any(not storage.environment for _, storage in system.descriptor().storages)


def assert_product(system, prescribed, seed, count):
    """The parts are so many, and unknowns that solve or miss their equations do so in the whole by the same numbers.

    Flows into what prescribes an effort are split among the parts at random; balances there are the sums of theirs.
    """
    d, rng, held = system.descriptor(), np.random.default_rng(seed), frozenset(map(Path.of, prescribed))
    parts = factors_of(d, held)
    assert len(parts) == count
    identity = np.concatenate([np.zeros(0), *(manifold(slot.quantity.space).identity() for slot in d.states)])
    x = d.advance(identity, rng.normal(size=d.rate_size))
    inputs = {slot.path: Input(rng.normal(size=slot.quantity.space.dim), slot.path in held) for slot in d.outer}
    whole, places = labels(d, inputs), [labels(part.descriptor, inputs) for part in parts]
    z, times = rng.normal(size=len(whole)), np.zeros(len(whole))
    at = {label: i for i, label in enumerate(whole)}
    where = [np.array([at[label] for label in each], dtype=int) for each in places]
    for numbers in where:
        times[numbers] += 1.0
    assert times.min(initial=1.0) >= 1.0
    efforts = np.array([kind == "effort" for kind, *_ in whole], dtype=bool)
    expected, size, left = np.zeros(len(whole)), np.zeros(len(whole)), z.copy()
    for k, (part, numbers) in enumerate(zip(parts, where, strict=True)):
        later = np.isin(numbers, np.concatenate([np.zeros(0, dtype=int), *where[k + 1 :]]))
        mine = np.where(efforts[numbers], z[numbers], np.where(later, rng.normal(size=numbers.size), left[numbers]))
        left[numbers] -= mine
        own = {slot.path: inputs[slot.path] for slot in part.descriptor.outer}
        found = part.descriptor.residual(ContinuousBehaviour(REFERENCE), x[part.states], own, mine)
        expected[numbers] = np.where(efforts[numbers], expected[numbers] + found, found)
        size = np.maximum(size, largest(found, initial=1.0))
    found = d.residual(ContinuousBehaviour(REFERENCE), x, inputs, z)
    scale = (1.0 + largest(z, initial=0.0)) * size.max(initial=1.0)
    assert largest(found - expected) <= 64 * EPS * scale


def labels(d, inputs):
    """What each unknown is, and each equation in its place: of storages, balances, conditions, prescribed efforts."""
    of = [("rate", slot.path, slot.quantity.space.dim) for slot in d.states]
    of += [("effort", slot.path, slot.quantity.space.dim) for slot in d.junctions]
    of += [("multiplier", slot.path, slot.multipliers) for slot in d.components]
    of += [("flow", slot.path, slot.quantity.space.dim) for slot in d.outer if inputs[slot.path].effort]
    return [(kind, path, i) for kind, path, size in of for i in range(size)]
