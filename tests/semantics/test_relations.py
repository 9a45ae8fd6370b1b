"""Where patterns meet meaning: the edge cases, state links, and the two routes where naive flattening fails."""

from dataclasses import replace

import numpy as np
import pytest

from ephs.operad import Path, Pattern, PatternError, junction, quantity
from ephs.semantics import Reference, SemanticsError, System, library
from ephs.semantics.meaning import relation_of_pattern
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.variables import RelationVariable

Q = quantity


def test_naive_absorption_of_a_state_port_is_not_functorial():
    """Two junctions that share a state keep two efforts and two balances; merging them is another relation."""
    lower = Pattern.from_text("l: momentum, exposed as state; a(p=l); b(p=l)")
    flat = Pattern.from_text("j: momentum; low(l=~j); c(p=j); d(p=j)").substitute(low=lower)
    merged = Pattern(junctions={"j": junction(Q.momentum)}, boxes={box: {"p": "j"} for box in flat.boxes})
    ours, naive = (relation_of_pattern(Rational(), pattern) for pattern in (flat, merged))
    assert ours.variables == naive.variables
    assert ours.dimension == naive.dimension == 4
    assert not ours.same(naive)

    def at(kind, box):
        return RelationVariable("inner", kind, Path.parse(box), Path.parse("p"), 0)

    # nested: the lower balance and the upper balance, glued by the state alone
    sums = [{at("flow", one): 1, at("flow", other): 1} for one, other in (("low.a", "low.b"), ("c", "d"))]
    shared = [{at("effort", one): 1, at("effort", other): -1} for one, other in (("low.a", "low.b"), ("c", "d"))]
    assert ours.same(replace(ours, equations=(*sums, *shared)))


@pytest.mark.parametrize("missing", ["pe", "extra"])
def test_fillings_are_complete_and_fit(missing):
    osc = Pattern.from_text("q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)")
    parts = {"pe": library.spring(k=1.0), "ke": library.point_mass(m=1.0), "pkc": library.pkc()}
    if missing == "extra":
        parts["extra"] = library.spring(k=1.0)
    else:
        del parts[missing]
    with pytest.raises(PatternError, match=f"box {missing}: found fillings for .*, expected one for each"):
        osc(**parts)


def test_a_filling_with_another_interface_is_refused_with_both_sides():
    lone = Pattern.from_text("q: displacement; pe(q)")
    with pytest.raises(PatternError, match=r"box pe: the filling's interface does not match.*momentum.*displacement"):
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
