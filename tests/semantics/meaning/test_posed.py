"""Which states have a motion, and one: what says so, what runs, and what the laws of gluing are in exact numbers."""

import math
import re
from functools import wraps

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.elements.components import gravity, holonomic, pair_spring
from ephs.operad import ROOT, Path
from ephs.semantics import SemanticsError
from ephs.semantics.descriptor.curvature import curvature, turned
from ephs.semantics.meaning import relation_of_pattern
from ephs.semantics.meaning.fields import Rational, Rounded, as_written
from ephs.semantics.meaning.functor import filled
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.variables import RelationVariable
from ephs.semantics.primitives.differences import slope
from ephs.semantics.spaces import PAIRS, manifold, pair
from ephs.testing import nestings
from tests.numerics import largest
from tests.semantics.test_base import COUPLED
from tests.semantics.zoo import drag

TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
OPEN = {
    # a storage whose effort a junction without storage holds at zero
    "mass": (
        Pattern.from_text("x: displacement; p: momentum; a(p); g(q=x, p)")(a=lib.point_mass(m=1.0), g=lib.pkc()),
        "a.p",
        "x",
    ),
    "inductor": (
        Pattern.from_text("q: charge; b: flux_linkage; a(b); g(q, b)")(
            a=lib.inductor(l=2.0), g=ephs.gyrator({"q": Q.charge, "b": Q.flux_linkage}, TURN)
        ),
        "a.b",
        "q",
    ),
    "two levels": (
        Pattern.from_text("p: momentum; a(p); o(p)")(
            a=lib.point_mass(m=3.0),
            o=Pattern.from_text("x: displacement; p: momentum, exposed; g(q=x, p)")(g=lib.pkc()),
        ),
        "a.p",
        "o.x",
    ),
}
METHODS = ("auto", "natural", "natural4", "radau", "rk54")


@pytest.mark.parametrize("case", OPEN)
def test_a_state_without_motion_is_empty_and_says_by_which_equations(case):
    system, state, junction = OPEN[case]
    for route in ("flat", "nested"):
        moving = system.relation(route=route).at({state: 1.0})
        assert moving.empty and not moving.determined
        words = " ".join(moving.empty.because)
        assert f"flow balance of junction {junction} " in words and "component a " in words
        resting = system.relation(route=route).at({state: 0.0})
        assert not resting.empty and resting.determined


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", OPEN)
def test_no_method_runs_from_a_state_without_motion(case, method):
    system, state, junction = OPEN[case]
    with pytest.raises(ephs.SimulationError, match=f"no motion exists: .*flow balance of junction {junction} "):
        ephs.simulate(system, 0.05, initial={state: 1.0}, step=0.01, method=method)


@pytest.mark.parametrize("case", OPEN)
def test_check_names_the_junction(case):
    system, state, junction = OPEN[case]
    found = system.check(state={state: 1.0})
    (motion,) = (item for item in found.items if item.name == "motion")
    assert not found.ok and not motion.ok and f"junction {junction}" in motion.detail
    assert system.check(state={state: 0.0}).ok
    for form in ("relation", "descriptor"):
        equations = system.with_initial({state: 1.0}).equations(form)
        words = f"at the start no motion exists: .*junction {junction} "
        assert re.search(words, str(equations)) and re.search(words, equations.latex().replace("\\", ""))
        assert "no motion exists" in equations._repr_latex_() and not system.equations(form).doubt


def test_what_an_irreversible_component_does_is_not_known_before_the_efforts():
    """A spring on a damper of quadratic force has a motion, q̇ = −√(k q): at rest M is zero, which says nothing."""
    damper = drag(lambda p, s: abs(p))()
    system = Pattern.from_text("q: displacement; p: momentum; s: entropy; k(q); g(q, p); d(p, s); env(s)")(
        k=lib.spring(k=1.0), g=lib.pkc(), d=damper, env=lib.environment()
    )
    assert not system.relation().at({"k.q": 1.0}).empty
    there = system.relation().at({"k.q": 1.0}, efforts={"d": [-1.0, 0.0]})
    assert there.determined and there.values[Path.parse("k.q")] == pytest.approx(-1.0)


def test_what_nothing_determines_is_named():
    loose = Pattern.from_text("p: momentum; q: momentum; a(p); l(p, p2=q); b(p=q)")(
        a=lib.point_mass(m=1.0), l=lib.rigid_link(), b=lib.point_mass(m=1.0)
    )
    assert loose.relation().at({"a.p": 1.0, "b.p": 1.0}).determined  # once the link's condition is differentiated
    doubled = Pattern.from_text("q: displacement; p: momentum; g(q, p)")(g=lib.pkc())
    assert doubled.relation().at().determined  # no state at all
    heat = Pattern.from_text("s: entropy; a(s); t: entropy; b(s=t); w(s, t)")(
        a=lib.environment(),
        b=lib.environment(),
        w=ephs.constraint({"s": Q.entropy, "t": Q.entropy}, np.array([[1.0, -1.0]])),
    )
    answer = heat.relation().at().determined
    assert not answer and "the rate of a.s is arbitrary" in answer.because
    assert "not known to be determined: the rate of a.s is arbitrary" in str(heat.equations("relation"))


def test_storages_on_linked_junctions_have_one_rate():
    mass = lib.point_mass(m=1.0)
    system = COUPLED(s=lib.spring(k=1.0), t=lib.spring(k=1.0), m=mass, n=mass, x=lib.pkc(), y=lib.pkc())
    for route in ("flat", "nested"):
        together = system.relation(route=route).at({"s.q": 0.5, "m.p": 2.0, "n.p": 2.0})
        assert together.values[Path.parse("s.q")] == 2.0 and not together.empty
        assert system.relation(route=route).at({"s.q": 0.5, "m.p": 1.0, "n.p": 3.0}).empty


@settings(suppress_health_check=list(HealthCheck), max_examples=25)
@given(nestings(max_depth=2))
def test_the_relation_of_a_composite_pattern_is_the_composite_of_the_relations(nesting):
    """F(f ∘ g) = F(f) ∘ F(g), in ℚ and in floats; and not where a balance is missing."""
    f, inner = nesting.pattern, {box: each.pattern for box, each in nesting.children.items()}
    whole = f.substitute(inner)
    for field in (Rational(), Rounded()):
        parts = {box: relation_of_pattern(field, g) for box, g in inner.items()}
        found = filled(relation_of_pattern(field, f), parts)
        assert found.same(relation_of_pattern(field, whole))
        of = relation_of_pattern(field, f)
        units = {box: Pattern.identity(content.interface) for box, content in f.boxes.items()}
        same = {box: relation_of_pattern(field, unit) for box, unit in units.items()}
        assert filled(of, same).same(of)
        if of.equations:  # none is implied by the others, but inside of a part one may be
            less = LinearRelation.of(field, of.variables, of.equations[1:])
            assert not filled(less, same).same(of)
    identity = Pattern.identity(f.interface)
    exact = relation_of_pattern(Rational(), f)
    assert filled(relation_of_pattern(Rational(), identity), {ROOT: exact}).same(exact)


def test_exact_relations_leave_the_efforts_of_storages_open():
    system = Pattern.from_text("q: displacement; p: momentum, exposed; k(q); g(q, p)")(k=lib.spring(k=3.0), g=lib.pkc())
    exact = system.relation(field="rational").at().linear
    rate, effort = (RelationVariable("own", kind, ROOT, Path.parse("k.q"), 0) for kind in ("rate", "effort"))
    flow, velocity = (RelationVariable("outer", kind, ROOT, Path.parse("p"), 0) for kind in ("flow", "effort"))
    assert {frozenset(row.items()) for row in exact.canonical} == {
        frozenset({flow: 1, effort: -1}.items()),
        frozenset({velocity: 1, rate: -1}.items()),
    }
    damped = Pattern.from_text("p: momentum; s: entropy; m(p); d(p, s); env(s)")(
        m=lib.point_mass(m=1.0), d=lib.friction(d=1.0), env=lib.environment()
    )
    with pytest.raises(SemanticsError, match=r"d: its structure depends on efforts"):
        damped.relation(field="rational").at()


def test_numbers_know_what_is_near_zero():
    x, y = (RelationVariable("own", "rate", ROOT, Path.parse(name), 0) for name in "xy")

    def rank(field, entry):
        rows = [field.rounded({x: 1.0, y: 1.0}), field.rounded({x: 1.0, y: entry})]
        return 2 - LinearRelation.of(field, [x, y], rows).dimension

    field = Rounded()
    assert rank(field, 1.0 + 1.5e-15) == 1
    assert rank(field, 1.0 + 1e-9) == 2
    assert rank(field, 1.0) == 1
    assert rank(Rational(), 1.0 + 1.5e-15) == 2
    assert rank(Rational(as_written), 0.1 + 0.9) == 1


@pytest.mark.parametrize("apart", [0.0, 1e-12])
def test_spins_are_not_hidden_by_velocities(apart):
    """Two bodies held together at 1000 m/s: a difference of their spins of 1e-12 rad/s is a contradiction."""
    ports = {"p": Q.body_momentum, "p2": Q.body_momentum}
    hold = ephs.constraint(ports, np.hstack([np.eye(6), -np.eye(6)]))
    body = ephs.storage({"p": Q.body_momentum}, lambda p: 0.5 * (p @ p))
    system = Pattern.from_text("a: body_momentum; b: body_momentum; one(p=a); two(p=b); hold(p=a, p2=b)")(
        one=body, two=body, hold=hold
    )
    flight = np.array([0.0, 0.0, 0.0, 1000.0, 0.0, 0.0])
    found = system.relation().at({"one.p": flight + apart * np.eye(6)[0], "two.p": flight})
    assert bool(found.empty) == (apart > 0.0)


CURVED = {
    "a polynomial": (lambda a: 0.25 * a**4 - a**2, lambda a: [[3.0 * a**2 - 2.0]]),
    "a wave": (lambda a: np.cos(3.0 * a), lambda a: [[-9.0 * np.cos(3.0 * a)]]),
    "an exponential": (lambda a: np.exp(a) * 1e9, lambda a: [[1e9 * np.exp(a)]]),
    "two states": (lambda a, b: a * a * b + b**4, lambda a, b: [[2.0 * b, 2.0 * a], [2.0 * a, 12.0 * b * b]]),
}


@pytest.mark.parametrize("name", CURVED)
def test_the_curvature_of_a_recorded_energy_is_exact_and_else_differenced(name):
    energy, second = CURVED[name]
    for values in ((-1.3, 0.4), (0.2, -0.7), (2.0, 1.1)):
        point = dict(zip("ab" if name == "two states" else "a", values, strict=False))
        x = {Path.of(port): np.array([value]) for port, value in point.items()}
        ports = dict.fromkeys(point, Q.displacement)
        assert np.allclose(curvature(ephs.storage(ports, energy), x), second(**point), rtol=1e-14, atol=0.0)
        opaque = ephs.storage(ports, wraps(energy)(lambda **x: float(energy(**{p: float(x[p]) for p in x}))))
        assert np.allclose(curvature(opaque, x), second(**point), rtol=1e-3)


TURNED = {
    "gravity": gravity(np.array([1.0, 2.0, 3.0]), "SE3"),
    "gravity beside": gravity(np.array([1.0, 2.0, 3.0]), "SO3xR3"),
    "a spherical spring": pair_spring(pair("spherical"), np.full(3, 1.5), np.zeros(3)),
    "a planar spring": pair_spring(pair("planar"), np.full(3, 1.5), np.zeros(3)),
    "a function": ephs.storage({"q": Q.pose}, lambda q: q[1] ** 2 * q[4] + q[5] ** 2 * q[2] ** 2),
}


@pytest.mark.parametrize("name", TURNED)
def test_the_curvature_on_groups_is_that_of_the_efforts_along_increments(name):
    storage, rng = TURNED[name], np.random.default_rng(5)
    x = {port: manifold(storage.interface[port].quantity.space).random(rng) for port in storage.reads}
    found = curvature(storage, x)
    expected = slope(lambda v: storage.effort(storage.retract(x, v), ephs.Reference()), np.zeros(storage.bundle.size))
    assert np.allclose(found, expected, rtol=1e-8, atol=1e-8)
    # the bracket of increments makes it asymmetric where there is an effort
    assert largest(found - found.T) > 0.1 or name in ("gravity beside", "a planar spring")


@pytest.mark.parametrize("scale", [50.0, 1.0, 1e-2, 1e-4])
def test_differences_fit_the_scale_on_which_an_energy_varies(scale):
    """That of a gas of a small volume and heat capacity; steps of at most 1e-3 have the rounding of two differences."""
    ports, at = {"s": Q.entropy, "v": Q.volume}, {"s": 0.3 * scale, "v": 1e-3 * scale}
    point = {Path.of(name): np.array([value]) for name, value in at.items()}
    recorded = ephs.storage(ports, lambda s, v: scale * np.exp(s / scale) * (scale / v) ** 0.4)
    plain = ephs.storage(
        ports, lambda s, v: scale * math.exp(float(s) / scale) * math.exp(0.4 * math.log(scale / float(v)))
    )
    assert plain.kernel is None
    assert np.allclose(plain.effort(point, ephs.Reference()), recorded.effort(point, ephs.Reference()), rtol=1e-8)
    assert np.allclose(curvature(plain, point), curvature(recorded, point), rtol=1e-7 * max(1.0, scale))


PULLED = {"a": Q.momentum, "b": Q.momentum, "~q": Q.displacement}


def _turning(ratio, x):
    """By the efforts a and b of a constraint a + ratio(q) b = 0, at the rate 3."""
    made = ephs.constraint(PULLED, lambda q: np.array([[1.0, ratio(q)]]), multipliers=1)
    return [turned(made, {Path.of("q"): np.array([x])}, e, np.array([3.0]), ephs.Reference())[0] for e in np.eye(2)]


@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e-7])
@pytest.mark.parametrize("x", [-0.7, 0.1, 2.0])
def test_the_turning_of_a_recorded_constraint_is_exact(scale, x):
    """At lengths of any scale, which no step of differences fits; that of a plain function is by one of 5e-7."""
    expected = 3.0 * np.cos(x) / scale
    assert _turning(lambda q: np.sin(q / scale), x * scale) == pytest.approx([0.0, expected], rel=1e-14)
    differenced = _turning(lambda q: math.sin(float(q) / scale), x * scale)[1]
    assert (abs(differenced - expected) <= 1e-5 * abs(expected)) == (scale > 1e-6)


@pytest.mark.parametrize("kind", [name for name in PAIRS if name != "fixed"])
@pytest.mark.parametrize("on_group", [True, False])
def test_the_turning_of_joints_is_that_of_their_constraints(kind, on_group):
    rng = np.random.default_rng(3)
    joint = holonomic(pair(kind, **dict.fromkeys(PAIRS[kind].parameters, 0.3)), on_group=on_group)
    (read,), group = joint.reads, manifold(joint.interface[joint.reads[0]].quantity.space)
    x, rates, e = (
        group.exp(0.5 * rng.standard_normal(group.dim)),
        rng.standard_normal(group.dim),
        rng.standard_normal(12 + group.dim),
    )

    def residual_after(h):
        return joint.structure({read: group.retract(x, h * rates)})[1] @ e

    expected = (
        8.0 * (residual_after(1e-3) - residual_after(-1e-3)) - residual_after(2e-3) + residual_after(-2e-3)
    ) / 12e-3
    assert largest(turned(joint, {read: x}, e, rates, ephs.Reference()) - expected) <= 1e-10 * largest(expected)
