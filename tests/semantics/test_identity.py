"""What a primitive is: what it says of itself makes it equal to another."""

from dataclasses import fields, replace

import numpy as np
import pytest

import ephs
from ephs.operad import Path
from ephs.operad import quantity as Q
from ephs.semantics import Storage, library
from ephs.semantics.derive.linear import Linear
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.primitives import Kernel

KINDS = [library.spring(k=2.0), library.pkc(), library.mkc(), library.friction(d=0.3), library.environment()]


def _unsaid(primitive):
    """The fields that are functions, or for their sake."""
    names = {"energy", "gradient", "discrete_gradient", "structure", "discrete", "matrix"}
    return [f.name for f in fields(primitive) if f.name in names | {"kernel", "formula", "notation", "trusted"}]


@pytest.mark.parametrize("primitive", KINDS, ids=lambda p: p.name)
def test_primitives_are_equal_by_what_they_say_and_not_by_their_functions(primitive):
    def other(*_):
        raise AssertionError("not asked")

    for name in _unsaid(primitive):
        value = Kernel("no_effort", Linear("no_effort")) if name == "kernel" else True if name == "trusted" else other
        assert replace(primitive, trusted=True, **{name: value} if name != "trusted" else {}) == primitive, name
    assert replace(primitive, name="another") != primitive
    assert replace(primitive, parameters=(("k", 3.0),)) != primitive


@pytest.mark.parametrize("primitive", KINDS, ids=lambda p: p.name)
def test_what_is_for_the_machine_is_not_shown(primitive):
    text = repr(replace(primitive, trusted=True))
    assert primitive.name in text
    assert not [name for name in ("kernel", "formula", "notation", "trusted") if f"{name}=" in text]


ONE = library.power_ports(q=Q.displacement)
TWO = library.power_ports(p=Q.momentum, s=Q.entropy)
WRONG = {
    "storage": lambda **so: Storage("w", ONE, lambda x: float(x[Path.of("q")][0] ** 2), lambda x: np.ones(1), **so),
    "quadratic": lambda **so: structures.quadratic(
        "w", library.power_ports(q=Q.displacement, p=Q.momentum), np.array([[1.0, 2.0], [0.0, 1.0]]), (), **so
    ),
    "constant": lambda **so: structures.constant_structure("w", ONE, np.ones((1, 1)), np.zeros((0, 1)), **so),
    "dissipation": lambda **so: structures.dissipation("w", TWO, np.array([[-1.0]]), **so),
    "coupling": lambda **so: structures.coupling("w", library.power_ports(q=Q.entropy, p=Q.momentum), **so),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_checks_are_made_unless_told_otherwise(name):
    with pytest.raises(ephs.StructureError):
        WRONG[name]()
    assert WRONG[name](trusted=True).name == "w"


def test_the_environment_stores_no_energy():
    environment = library.environment()
    assert environment.environment and not library.thermal_capacity(c1=1.0, c2=1.0).environment
    assert environment.energy({Path.of("s"): np.array([3.0])}) == 0.0


def test_a_transformer_has_two_ports_and_says_which_it_found():
    with pytest.raises(ephs.StructureError, match="ports is p, expected two power ports or more"):
        ephs.transformer({"p": Q.momentum, "~q": Q.angle}, [[1.0]])
