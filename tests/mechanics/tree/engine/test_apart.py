"""Columns of a Jacobian that share a direction are those of one direction each, to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.methods import jacobian
from ephs.mechanics.tree.engine.apart import directions
from tests.numerics import largest
from tests.scenes import equations_of
from tests.written import scene_of_text

BODY = """
[bodies.{name}]
mass = 1.0
inertia = [7e-3, 8e-3, 9e-3]
position = {at}
rotation = {{ axis = [1.0, 2.0, 0.5], angle = 0.01 }}
velocity = [0.3, -0.1, -0.2]
angular_velocity = [0.1, 0.4, -0.2]
[surfaces.{name}]
body = "{name}"
shape = {{ {shape} }}
stiffness = 1e5
loss = 0.3
friction = 0.5
{heat}
"""
FLOOR = """
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
NODE = """
[thermal.store]
capacity = 10.0
temperature = 300.0
"""
BOX, BALL = "box = [0.2, 0.2, 0.2]", "sphere = 0.1"


def pairs(*names):
    return "".join(f'[contacts.{one}_{other}]\nsurfaces = ["{one}", "{other}"]\n' for one, other in names)


def scene(kind):
    """A stack of boxes that press; balls on the floor, far from each other; balls that warm one store."""
    text = f'format = 1\nname = "{kind}"\n' + FLOOR
    if kind == "boxes":
        names, heat = "abcd", ""
        text += "".join(
            BODY.format(name=name, at=[0.0, 0.0, 0.099 + 0.199 * i], shape=BOX, heat=heat)
            for i, name in enumerate(names)
        )
        return text + pairs(("floor", "a"), ("a", "b"), ("b", "c"), ("c", "d"))
    heat = 'heat = "store"' if kind == "warm" else ""
    text += NODE if kind == "warm" else ""
    text += "".join(BODY.format(name=name, at=[x, 0.0, 0.099], shape=BALL, heat=heat) for x, name in enumerate("abc"))
    return text + pairs(("floor", "a"), ("floor", "b"), ("floor", "c"))


@pytest.mark.parametrize(("kind", "most"), [("boxes", 9), ("balls", 3), ("warm", 10)])
def test_directions_are_shared_without_another_bit(kind, most, monkeypatch):
    """A stack needs three bodies' columns at once, bodies that do not meet one's; what warms one store is apart."""
    equations = equations_of(scene_of_text(scene(kind)))
    state = equations.start(0.0)
    found = []

    def shared(columns, size):
        found.append(directions(columns, size))
        return found[-1]

    monkeypatch.setattr(jacobian, "directions", shared)
    matrix = jacobian.Jacobian(equations).at(state).copy()
    assert len(found[0]) <= 4 * most
    monkeypatch.setattr(jacobian, "directions", lambda columns, size: [[(c, np.arange(size))] for c, _ in columns])
    assert np.array_equal(matrix, jacobian.Jacobian(equations).at(state))
    assert largest(matrix) > 1e4  # they press


@given(st.lists(st.tuples(st.integers(0, 30), st.sets(st.integers(0, 9), min_size=1)), max_size=30))
def test_no_two_columns_of_a_direction_share_a_row(drawn):
    columns = [(column, np.array(sorted(rows))) for column, rows in drawn]
    found = directions(columns, 10)
    assert sorted(column for each in found for column, _ in each) == sorted(column for column, _ in columns)
    for each in found:
        rows = np.concatenate([rows for _, rows in each])
        assert len(np.unique(rows)) == len(rows)
