"""The edge cases of interconnection, each with its decision: what is a pattern, what it means, what is refused."""

import pytest

from ephs.operad import Path, Pattern
from ephs.semantics import AssemblyError, library
from ephs.semantics.meaning import relation_of_pattern
from ephs.semantics.meaning.fields import Rational

ALLOWED = {
    # case: (pattern, remarks, flows that are zero)
    "outer power port over state ports only": ("q: displacement, exposed; a(~q); b(~q)", ["open-circuit"], ["flow q"]),
    "outer state port over power ports": ("q: displacement, exposed as state; a(q); b(q)", [], []),
    "outer ports of two boxes meet one junction": ("q: displacement; a(q); b(q)", [], []),
    "two ports of one box on one junction": ("q: displacement; a(x=q, y=q)", [], []),
    "one inner power port, not exposed": ("q: displacement; a(q)", [], ["flow a.q"]),
    "one inner state port, not exposed": ("q: displacement; a(~q)", [], []),
    "a box without ports": ("a()", [], []),
    "no box and no junction": ("", [], []),
    "a state that is read and stored nowhere": ("q: displacement; a(~q)", [], []),
    "two power balances of one state": (
        "q: displacement; r: displacement; a(q); b(r); q ~ r",
        ["linked-balances"],
        ["flow a.q", "flow b.r"],
    ),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_what_is_allowed_means_a_dirac_structure(case):
    text, remarks, still = ALLOWED[case]
    f = Pattern.from_text(text)
    assert [remark.kind for remark in f.lint()] == remarks
    relation = relation_of_pattern(Rational(), f)
    assert 2 * relation.dimension == len(relation.variables)
    assert {str(v) for v, row in relation.solved().items() if not row} == set(still)


NOT_ASSEMBLED = {
    "two storages on one junction": (
        "q: displacement; a(q); b(q)",
        {"a": library.spring(k=1.0), "b": library.spring(k=2.0)},
        ["a.q and b.q", "constraint component"],
    ),
    "a state that is read and stored nowhere": (
        "b: flux_linkage; p: angular_momentum; bs: flux_linkage; mkc(b, p, ~bs); coil(b); rotor(p)",
        {"mkc": library.mkc(), "coil": library.inductor(l=1.0), "rotor": library.rotor(j=1.0)},
        ["mkc", "bs"],
    ),
}


@pytest.mark.parametrize("case", NOT_ASSEMBLED)
def test_what_means_something_but_cannot_be_simulated_is_refused_by_the_assembler(case):
    text, fillings, words = NOT_ASSEMBLED[case]
    system = Pattern.from_text(text)(fillings)
    with pytest.raises(AssemblyError) as caught:
        system.descriptor()
    assert all(word in str(caught.value) for word in words), caught.value
    state = {str(path): 1.0 for path in system.states}
    flat, nested = (system.relation(route=route).at(state) for route in ("flat", "nested"))
    assert flat.same(nested) and len(flat.rates) == sum(bool(each.stores) for each in flat.relation.classes)


def test_an_effort_that_nobody_provides_is_an_unknown():
    f = Pattern.from_text("p: momentum; j: momentum; s: entropy; m(p); link(p, p2=j); drag(p=j, s); env(s)")
    system = f(
        m=library.point_mass(m=2.0), link=library.rigid_link(), drag=library.friction(d=0.5), env=library.environment()
    )
    both = [system.relation(route=route).at({"m.p": 1.0}, efforts={"drag": [0.5, 0.0]}) for route in ("flat", "nested")]
    assert both[0].same(both[1]) and len(both[0].rates) == 2
    assert both[0].values[Path.of("m.p")] == pytest.approx(-0.25)
