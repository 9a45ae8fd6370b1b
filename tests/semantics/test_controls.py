"""Each law of systems fails where it should: on components that are not what they claim to be."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.operad import Directory, Path, PortType
from ephs.semantics import Reference, Reversible, System
from ephs.semantics.meaning import LinearRelation, relation_of, relation_of_pattern
from ephs.semantics.primitives import structures
from ephs.semantics.systems import balances, laws
from ephs.semantics.systems.laws import SYSTEM_LAWS, Verdict, random_probe, system_law
from ephs.semantics.systems.system import as_system

INNER = Pattern.from_text(
    "q: displacement; p: momentum, exposed; s: entropy, exposed; spring(q); mass(p); turn(q, p); rub(p, s)"
)
OUTER = Pattern.from_text(
    "p: momentum; s: entropy; t: entropy; v: volume; w: volume, exposed; "
    "osc(p, s); env(s); hot(s=t); wall(s1=s, s2=t); a(v); b(v=w); valve(v, w)"
)
SPRING = Path.of("osc.spring.q")
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def ports(**quantities):
    return Directory({Path.of(name): PortType(quantity) for name, quantity in quantities.items()})


def process(interface, skew):
    """A component f = L e that nobody checked."""
    return Reversible("planted", interface, lambda _x: (skew(), np.zeros((0, 2))), trusted=True)


def fickle(size):
    """A component that is no function: each evaluation gives another matrix, by so much."""
    calls = count()
    return process(ports(q=Q.displacement, p=Q.momentum), lambda: (1.0 + size * next(calls)) * TURN)


def constant(interface, *rows):
    return process(interface, lambda: np.array(rows))


def misjudging(storage):
    """A storage that takes a hundredth too much effort over a step."""
    return replace(
        storage,
        discrete_gradient=lambda x0, v: 1.01 * storage.energy_gradient(storage.retract(x0, 0.5 * v)),
        kernel=None,
        trusted=True,
    )


def cooling(process):
    """Friction backwards."""
    return replace(process, matrix=lambda x, e, reference: -process.matrix(x, e, reference), kernel=None, trusted=True)


FLAT = Pattern.from_text("j: displacement; k: displacement; a(q=j); b(q=k)")(a=lib.spring(k=1.0), b=lib.spring(k=2.0))
TANK = structures.quadratic("tank", ports(v=Q.volume), np.array([[2.0]]), ())
FINE = {
    "spring": lib.spring(k=2.0),
    "mass": lib.point_mass(m=1.5),
    "turn": lib.pkc(),
    "rub": lib.friction(d=0.3),
    "env": lib.environment(),
    "hot": lib.thermal_capacity(c1=6000.0, c2=20.0),
    "wall": lib.heat_transfer(h=5.0),
    "a": TANK,
    "b": TANK,
    "valve": constant(ports(v=Q.volume, w=Q.volume), [0.0, 0.0], [0.0, 0.0]),
}
PLANTED = {
    "functoriality": {"turn": fickle(1e-5)},
    "renaming": {"turn": fickle(1e-5)},
    "Dirac": {"turn": constant(ports(q=Q.displacement, p=Q.momentum), [1e-5, -1.0], [1.0, 0.0])},
    "power balance": {"spring": misjudging(lib.spring(k=2.0))},
    "exergy balance": {"spring": misjudging(lib.spring(k=2.0))},
    "entropy balance": {"wall": constant(ports(s1=Q.entropy, s2=Q.entropy), [0.0, 0.1], [0.1, 0.0])},
    "conservation": {"valve": constant(ports(v=Q.volume, w=Q.volume), [0.1, 0.0], [0.0, 0.1])},
    "entropy production": {"rub": cooling(lib.friction(d=0.3))},
}


def system(**planted):
    parts = FINE | planted
    inner = INNER({name: parts.pop(name) for name in ("spring", "mass", "turn", "rub")})
    return OUTER(parts | {"osc": inner})


@pytest.mark.parametrize("law", SYSTEM_LAWS, ids=lambda law: law.name)
def test_every_law_holds_of_the_sound_system(law):
    for seed in range(2):
        assert law(random_probe(system(), seed)).holds


@pytest.mark.parametrize("name", PLANTED)
def test_a_law_fails_on_its_control(name):
    for seed in range(2):
        verdict = system_law(name)(random_probe(system(**PLANTED[name]), seed))
        assert not verdict.holds and verdict.defect > 0.0, verdict


def test_every_law_has_a_control():
    assert {law.name for law in SYSTEM_LAWS} == {*PLANTED, "Tellegen", "naturality"}


def test_bases_that_differ_are_told(monkeypatch):
    def astray(whole, reference, *, route="flat"):
        found = relation_of(whole, reference, route)
        return found if route == "flat" else replace(found, classes=found.classes[1:])

    monkeypatch.setattr(System, "relation", astray)
    verdict = system_law("functoriality")(random_probe(FLAT))
    assert (verdict.defect, verdict.tolerance) == (np.inf, 0.0)
    assert verdict.detail == "the states of the base are a.q | b.q and b.q"


def test_verdicts_say_what_was_measured():
    probe = random_probe(system())
    assert probe.reference == Reference(293.15, 300.0)
    assert system_law("Tellegen")(probe).detail.startswith("2 patterns")
    assert system_law("renaming")(probe).detail.startswith("7 boxes renamed")
    alone = as_system(lib.spring(k=1.0))
    assert system_law("renaming")(random_probe(alone)) == Verdict(0.0, 0.0, "an identity, whose box has no name")
    with pytest.raises(KeyError):
        system_law("gravity")


def test_laws_are_vacuous_where_a_state_has_several_values():
    twice = Pattern.from_text("j: displacement; s(q=j); t(q=j)")(s=lib.spring(k=1.0), t=lib.spring(k=1.0))
    probe = replace(random_probe(twice), state={Path.of("s.q"): np.zeros(1), Path.of("t.q"): np.ones(1)})
    for name in ("functoriality", "renaming", "Dirac"):
        verdict = system_law(name)(probe)
        assert (verdict.holds and verdict.defect == verdict.tolerance == 0.0) or name == "functoriality"
    assert system_law("renaming")(probe).detail == "both relations are empty"
    assert system_law("Dirac")(probe).detail.startswith("one state has several values")


def test_a_route_that_takes_a_state_from_elsewhere_is_not_natural(monkeypatch):
    right = balances.solved

    def astray(whole, state, *others):
        return right(whole, {**state, SPRING: state[SPRING] + 1e-5} if whole.is_flat else state, *others)

    monkeypatch.setattr(balances, "solved", astray)
    verdict = system_law("naturality")(random_probe(system()))
    assert not verdict.holds and 1e-7 < verdict.defect < 1e-3


def changed(relation, change):
    """A relation with other equations."""
    return LinearRelation.of(relation.field, relation.variables, change([dict(row) for row in relation.equations]))


def flipped(rows):
    """The sign of the outer flow in each balance."""
    return [
        {v: -number if v.role == "outer" and v.kind == "flow" else number for v, number in row.items()} for row in rows
    ]


@pytest.mark.parametrize("wrong", [lambda rows: rows[:-1], lambda rows: [*rows, {next(iter(rows[0])): 1}], flipped])
def test_a_pattern_that_makes_power_or_has_too_many_freedoms_fails(monkeypatch, wrong):
    monkeypatch.setattr(laws, "relation_of_pattern", lambda *args: changed(relation_of_pattern(*args), wrong))
    verdict = system_law("Tellegen")(random_probe(system()))
    assert not verdict.holds and "makes or loses power" in verdict.detail


def test_boxes_are_renamed_beside_junctions_that_are_called_boxes():
    named = Pattern.from_text("box1: displacement; boxer: displacement; a(q=box1); b(q=boxer)")
    assert system_law("renaming")(random_probe(named(a=lib.spring(k=1.0), b=lib.spring(k=2.0)))).holds
