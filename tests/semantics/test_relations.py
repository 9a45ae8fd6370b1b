"""Where patterns meet meaning: the edge cases, state links, and the two routes where naive flattening fails."""

from dataclasses import replace

import numpy as np
import pytest

from ephs.operad import ROOT, Path, Pattern, PatternError, junction, quantity
from ephs.semantics import AssemblyError, Reference, SemanticsError, System, library
from ephs.semantics.meaning import relation_of_pattern
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.functor import glued
from ephs.semantics.meaning.variables import Variable
from ephs.semantics.primitives import structures
from tests.semantics.subspace import subspace_of

Q = quantity


def state_exposing_lower():
    return Pattern(
        junctions={"l": junction(Q.momentum, exposed=True, power=False)},
        boxes={"a": {"p": "l"}, "b": {"p": "l"}},
    )


def upper():
    return Pattern(junctions={"j": junction(Q.momentum)}, boxes={"low": {"l": "~j"}, "c": {"p": "j"}, "d": {"p": "j"}})


def test_naive_absorption_of_a_state_port_is_not_functorial():
    """Two junctions that share a state keep two efforts and two balances; merging them is another relation."""
    flat = upper().substitute(low=state_exposing_lower())
    merged = Pattern(
        junctions={"j": junction(Q.momentum)},
        boxes={"low.a": {"p": "j"}, "low.b": {"p": "j"}, "c": {"p": "j"}, "d": {"p": "j"}},
    )
    order = [str(box) for box in flat.boxes]
    permuted = Pattern(junctions={"j": junction(Q.momentum)}, boxes={box: {"p": "j"} for box in order})
    ours, naive = (relation_of_pattern(Rational(), pattern) for pattern in (flat, permuted))
    assert merged == permuted
    assert ours.variables == naive.variables
    assert ours.dimension == naive.dimension == 4
    assert not ours.same(naive)

    def at(kind, box):
        return Variable("inner", kind, Path.parse(box), Path.parse("p"), 0)

    # nested: the lower balance and the upper balance, glued by the state alone
    sums = [{at("flow", one): 1, at("flow", other): 1} for one, other in (("low.a", "low.b"), ("c", "d"))]
    shared = [{at("effort", one): 1, at("effort", other): -1} for one, other in (("low.a", "low.b"), ("c", "d"))]
    assert ours.same(replace(ours, equations=(*sums, *shared)))


def test_a_state_is_shared_through_three_levels():
    """The stator flux of a motor is read two levels down; both routes give the gyrator its modulus."""
    motor = Pattern(
        junctions={"b": junction(Q.flux_linkage, exposed=True), "p": junction(Q.angular_momentum, exposed=True),
                   "bs": junction(Q.flux_linkage, exposed=True, power=False)},
        boxes={"mkc": {"b": "b", "p": "p", "bs": "~bs"}},
    )  # fmt: skip
    middle = Pattern(
        junctions={"b": junction(Q.flux_linkage, exposed=True), "p": junction(Q.angular_momentum),
                   "bs": junction(Q.flux_linkage, exposed=True, power=False)},
        boxes={"motor": {"b": "b", "p": "p", "bs": "~bs"}, "rotor": {"p": "p"}},
    )  # fmt: skip
    top = Pattern(
        junctions={"b": junction(Q.flux_linkage), "bs": junction(Q.flux_linkage)},
        boxes={"machine": {"b": "b", "bs": "~bs"}, "coil": {"b": "b"}, "stator": {"b": "bs"}},
    )
    system = top(
        machine=middle(motor=motor(mkc=library.mkc()), rotor=library.rotor(j=2.0)),
        coil=library.inductor(l=0.5), stator=library.inductor(l=3.0),
    )  # fmt: skip
    for flux in (0.0, 0.7, -2.0):
        state = {"stator.b": flux, "coil.b": 0.4, "machine.rotor.p": 0.3}
        flat, nested = (system.relation(route=route).at(state) for route in ("flat", "nested"))
        assert flat.distance(nested) <= 1e-13
        assert flat.same(nested)
        assert flat.values[Path.parse("coil.b")] == pytest.approx(-flux * 0.3 / 2.0)
        assert flat.values[Path.parse("machine.rotor.p")] == pytest.approx(flux * 0.4 / 0.5)


def test_an_outer_power_port_over_state_ports_is_an_open_circuit():
    """Composes to f = 0, e free; and the pattern says so."""
    open_circuit = Pattern(
        junctions={"bs": junction(Q.flux_linkage, exposed=True), "b": junction(Q.flux_linkage, exposed=True),
                   "p": junction(Q.angular_momentum, exposed=True)},
        boxes={"mkc": {"b": "b", "p": "p", "bs": "~bs"}},
    )  # fmt: skip
    relation = open_circuit(mkc=library.mkc()).relation
    with pytest.raises(AssemblyError, match="bs"):
        open_circuit(mkc=library.mkc()).descriptor()
    nested = relation(route="nested").at()
    assert nested.distance(relation(route="flat").at()) <= 1e-14
    names = [str(path) for path, _ in nested.ports]
    assert np.abs(subspace_of(nested).basis[names.index("bs")]).max() <= 1e-15
    assert [note.kind for note in open_circuit.lint()] == ["open-circuit"]


def test_a_closed_port_has_no_flow():
    lone = Pattern(
        junctions={"p": junction(Q.momentum), "q": junction(Q.displacement)},
        boxes={"x": {"q": "q", "p": "p"}, "m": {"p": "p"}},
    )
    system = lone(x=library.pkc(), m=library.point_mass(m=2.0))
    flat, nested = (system.relation(route=route).at({"m.p": 1.0}) for route in ("flat", "nested"))
    assert flat.distance(nested) <= 1e-14


def test_two_storages_of_one_state_have_no_equations():
    twice = Pattern(junctions={"q": junction(Q.displacement)}, boxes={"a": {"q": "q"}, "b": {"q": "q"}})
    system = twice(a=library.spring(k=1.0), b=library.spring(k=2.0))
    with pytest.raises(AssemblyError, match=r"a\.q and b\.q.*constraint component") as caught:
        system.descriptor()
    assert "junction q" in str(caught.value)


def test_a_state_that_is_read_and_stored_nowhere_has_no_equations():
    reading = Pattern(
        junctions={
            "b": junction(Q.flux_linkage),
            "p": junction(Q.angular_momentum),
            "bs": junction(Q.flux_linkage),
        },
        boxes={"mkc": {"b": "b", "p": "p", "bs": "~bs"}, "coil": {"b": "b"}, "rotor": {"p": "p"}},
    )
    system = reading(mkc=library.mkc(), coil=library.inductor(l=1.0), rotor=library.rotor(j=1.0))
    with pytest.raises(AssemblyError, match=r"mkc.*bs"):
        system.descriptor()


def test_a_junction_that_no_storage_gives_its_effort_is_accepted():
    """Two resistors' worth of friction between two bodies: the effort at the joint is an unknown of its own."""
    link = Pattern(
        junctions={"p": junction(Q.momentum), "j": junction(Q.momentum), "s": junction(Q.entropy)},
        boxes={
            "m": {"p": "p"},
            "link": {"p": "p", "p2": "j"},
            "drag": {"p": "j", "s": "s"},
            "env": {"s": "s"},
        },
    )
    system = link(
        m=library.point_mass(m=2.0),
        link=library.rigid_link(),
        drag=library.friction(d=0.5),
        env=library.environment(),
    )
    relation = system.relation().at(
        {"m.p": 1.0}, efforts={next(p for p, _ in system.leaves() if str(p) == "drag"): np.array([0.5, 0.0])}
    )
    assert relation.values[Path.parse("m.p")] == pytest.approx(-0.25)


def test_a_box_with_two_ports_on_one_junction_adds_its_flows():
    both = Pattern(
        junctions={"v": junction(Q.volume), "p": junction(Q.momentum)},
        boxes={"piston": {"v1": "v", "v2": "v", "p": "p"}, "gas": {"v": "v"}, "m": {"p": "p"}},
    )
    balloon = structures.quadratic("balloon", library.power_ports(v=Q.volume), np.array([[3.0]]), ())
    system = both(piston=library.piston(a=0.3), gas=balloon, m=library.point_mass(m=1.0))
    state = {"gas.v": 1.0, "m.p": 2.0}
    flat, nested = (system.relation(route=route).at(state) for route in ("flat", "nested"))
    assert flat.distance(nested) <= 1e-13
    # what enters by one port leaves by the other
    assert {path: value.tolist() for path, value in flat.values.items()} == {
        Path.parse("gas.v"): [0.0],
        Path.parse("m.p"): [0.0],
    }


@pytest.mark.parametrize("missing", ["pe", "extra"])
def test_fillings_are_complete_and_fit(missing):
    osc = Pattern(
        junctions={"q": junction(Q.displacement), "p": junction(Q.momentum)},
        boxes={"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}},
    )
    parts = {"pe": library.spring(k=1.0), "ke": library.point_mass(m=1.0), "pkc": library.pkc()}
    if missing == "extra":
        parts["extra"] = library.spring(k=1.0)
    else:
        del parts[missing]
    with pytest.raises(PatternError, match=f"box {missing}: found fillings for .*, expected one for each"):
        osc(**parts)


def test_a_filling_with_another_interface_is_refused_with_both_sides():
    lone = Pattern(junctions={"q": junction(Q.displacement)}, boxes={"pe": {"q": "q"}})
    with pytest.raises(PatternError, match=r"box pe: .*momentum.*displacement"):
        lone(pe=library.point_mass(m=1.0))
    with pytest.raises(SemanticsError, match=r"pe.*momentum.*displacement"):
        System.of(lone, {"pe": library.point_mass(m=1.0)})
    with pytest.raises(PatternError, match=r"box pe: found float, expected an element of an algebra, such as a System"):
        lone(pe=3.0)


@pytest.mark.parametrize(
    ("temperature", "pressure"), [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (300.0, -1.0), (300.0, np.inf)]
)
def test_a_reference_environment_is_physical(temperature, pressure):
    with pytest.raises(ValueError, match="expected"):
        Reference(temperature, pressure)


def test_composition_of_relations_forgets_the_inner_ports():
    lone = Pattern(junctions={"p": junction(Q.momentum, exposed=True)}, boxes={"m": {"p": "p"}})
    inner = System.of(lone, {"m": library.point_mass(m=2.0)})
    part = inner.relation(route="nested").at({"m.p": 1.0})
    again = glued(part.point.field, Pattern.identity(inner.interface), {ROOT: part.linear})
    assert again.same(part.linear)
