"""Searches that could go on for ever end, with what keeps them going."""

import pytest

import ephs
from ephs import Path, Pattern
from ephs import library as lib
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.rewrite.rewrite import MOST, Rule, RuleSite, StateMap, Strength, rewrite
from ephs.mechanics.runs.assembling import flat_joints
from ephs.semantics.spaces import SE3
from tests.oscillator import oscillator


def same(_draft):
    return StateMap()


def longer(draft):
    """One more spring at the same place."""
    draft.add(Path((f"more{len(draft.fillings)}",)), lib.spring(k=1.0), {Path(("q",)): Path(("q",))})
    return StateMap()


def rule(make, last=None):
    """Of the spring at ``pe``, until there are so many boxes."""

    def at(draft, place):
        if last is not None and len(draft.fillings) >= last:
            return None
        return RuleSite("AGAIN", place[0], Strength.MOTION, "it is a spring", "", make)

    return Rule("AGAIN", Strength.MOTION, "always", lambda _: [(Path(("pe",)),)], at)


@pytest.mark.parametrize("make", [same, longer])
def test_rules_that_do_not_end_are_refused_with_their_place(make):
    size = 3 + 2  # boxes and junctions of the oscillator
    with pytest.raises(ephs.OptionError, match=f"AGAIN, used at pe after {MOST * size} rewrites of {size} parts"):
        rewrite(oscillator(), [rule(make)])


def test_rules_that_end_may_make_a_system_larger():
    """Ten springs of 1 N/m beside the first one."""
    assert len(rewrite(oscillator(), [rule(longer, last=13)]).system.fillings) == 13


def test_offsets_in_a_circle_are_named():
    """A frame is 0.1 m before one that is 0.1 m behind it; a joint holds a third one beside them."""
    there, back, none = [1.0, 0, 0, 0, 0.1, 0, 0], [1.0, 0, 0, 0, -0.1, 0, 0], SE3.identity()
    pattern = Pattern.from_text("earth: body_momentum; arm: body_momentum; a: body_momentum; b: body_momentum; "
"c: body_momentum; body(p=arm); base(p=earth); there(inner=a, outer=b); "
"back(inner=b, outer=a); beside(inner=c, outer=a); pin(p1=arm, p2=c); hold(p1=earth, p2=a)")  # fmt: skip
    system = pattern(
        body=rigid_body(1.0, [0.1, 0.1, 0.1], (0.0, 0.0, -9.81)),
        base=components.ground(),
        there=frame_change(there, "inner", "outer"),
        back=frame_change(back, "inner", "outer"),
        beside=frame_change(none, "inner", "outer"),
        pin=joint("revolute", none, none),
        hold=joint("revolute", none, none),
    )
    assert [fault.path for fault in flat_joints(system.descriptor()).frames.faults] == [Path(("there",))]
