"""Joints over a step and what is seen through maps: the same bits in floats and machine code, whatever the pair."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.mechanics.elements import components
from ephs.operad import Path, PortType
from ephs.semantics.derive.maps import Block, Maps
from ephs.semantics.derive.relations import program
from ephs.semantics.primitives.pullback import Map, pull_back, pulled_ports
from ephs.semantics.spaces import PAIRS, SE3, pair
from tests.numerics import EPS, generators, seeds
from tests.semantics.derive.test_relations import arguments
from tests.semantics.zoo import drag
from tests.staged import run_both

MOMENTUM = PortType(Q.body_momentum, True)

MAPS = {
    "offset": lambda rng: Map(SE3.adjoint(SE3.inverse(SE3.random(rng))), MOMENTUM),
    "any": lambda rng: Map(rng.standard_normal((6, 6)), MOMENTUM),
    "ground": lambda rng: Map(np.zeros((6, 0)), None),
}


def joint(kind, ends=(), seed=0):
    """A joint whose ends are seen through maps."""
    rng = np.random.default_rng(seed)
    made = components.holonomic(pair(kind, **dict.fromkeys(PAIRS[kind].parameters, 0.3)))
    return pull_back(made, {Path.of(f"p_j{i + 1}"): MAPS[end](rng) for i, end in enumerate(ends)}) if ends else made


def seen_drag(_seed):
    """Friction that is seen through a map of two velocities to one."""
    return pull_back(drag(lambda p, s: abs(p))(), {Path.of("p"): Map(np.array([[0.7]]), PortType(Q.momentum, True))})


def rod(seed):
    """A traced constraint seen through a map."""
    rng = np.random.default_rng(seed)
    made = ephs.constraint(
        {"p": Q.body_momentum, "p2": Q.momentum, "~q": Q.pose},
        lambda q: [[q[1] * q[0], q[2] ** 2, 0.0, q[4], 0.0, 1.0, q[5]]],
    )
    return pull_back(made, {Path.of("p"): Map(rng.standard_normal((6, 6)), MOMENTUM)})


CASES = {kind: lambda seed, kind=kind: joint(kind, (), seed) for kind in PAIRS}
CASES |= {f"revolute {' '.join(ends)}": lambda seed, ends=ends: joint("revolute", ends, seed)
          for ends in (("offset", "offset"), ("ground", "any"), ("offset", "ground"))}  # fmt: skip
CASES |= {"drag": seen_drag, "rod": rod}


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=3)
@given(seed=seeds, h=st.sampled_from([0.0, 1e-8, 1e-2]))
def test_floats_and_machine_code_give_the_same_bits(name, seed, h):
    primitive = CASES[name](seed)
    relation = primitive.kernel.relation
    a, _ = arguments(relation, primitive, np.random.default_rng(seed), 0.1)
    a["scal"][0] = h
    status, _, *found = run_both(program(relation), "value", np.array(relation.dimensions), *a.values(), signed=False)
    assert status == 0 and dict(zip(a, found, strict=True))["jac"].any()


@given(rng=generators)
def test_power_is_the_same_on_both_sides_of_a_map(rng):
    """⟨Tᵀ f'|e⟩ = ⟨f'|T e⟩, and the matrices come back from their numbers."""
    matrices = [SE3.adjoint(SE3.random(rng)), rng.standard_normal((3, 2)), np.eye(2), np.zeros((6, 0))]
    maps, numbers = Maps.of_matrices(matrices)
    assert [block.sort for block in maps.blocks] == ["frame", "any", "same", "any"]
    rows = maps.rows(numbers)
    for block, matrix, found in zip(maps.blocks, matrices, rows, strict=True):
        assert np.array_equal(np.array(found).reshape(matrix.shape), matrix) and block == Block.of_matrix(matrix)
    e, f = rng.standard_normal(maps.outside), rng.standard_normal(maps.inside)
    inward, outward = np.array(maps.inward(rows, e.tolist())), np.array(maps.outward(rows, f.tolist()))
    terms = np.abs(f) @ np.abs(inward) + np.abs(outward) @ np.abs(e)
    assert abs(f @ inward - outward @ e) <= 8 * f.size * EPS * terms


@pytest.mark.parametrize("ends", [("offset", "any"), ("ground", "offset")])
def test_the_ports_of_a_map_are_told(ends):
    found = pulled_ports(joint("cylindrical", ends).kernel)
    dims = [(0, 6) if ends[0] == "ground" else (6, 6), (6, 6), (2, 2)]
    assert [matrix.shape[::-1] for *_, matrix in found] == dims
    assert [at for at, *_ in found] == [0, 6, 12]
    assert not pulled_ports(joint("cylindrical").kernel)
