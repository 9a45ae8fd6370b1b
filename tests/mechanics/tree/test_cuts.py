"""Cut joints: powers of rows, rates of what is open, accelerations; fitted elements."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.mechanics.road.cuts import Relative
from ephs.mechanics.road.loops import kinds_of, loop_program
from ephs.mechanics.road.records import LinkPlace, LinkState
from ephs.semantics.spaces import codes, se3, so3
from ephs.semantics.stage import PLAIN
from tests.numerics import largest, seeds
from tests.scenes import equations_of, shipped

Z = np.eye(6)[:, 2:3]
JOINTS = {
    "weld": (codes.VECTOR, 0, np.zeros((6, 0))),
    "revolute": (codes.VECTOR, 1, Z),
    "cylindrical": (codes.VECTOR, 2, np.eye(6)[:, [2, 5]]),
    "screw": (codes.VECTOR, 1, np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.2]]).T),
    "planar": (codes.SE2, 3, np.eye(6)[:, [2, 3, 4]]),
    "spherical": (codes.SO3, 4, np.eye(6)[:, :3]),
}
KINDS = kinds_of((code, size, basis.shape[1]) for code, size, basis in JOINTS.values())
RUN = loop_program(KINDS).compiled()


def frame(rng):
    """A random frame (R, p)."""
    pose = np.array(se3.exp(PLAIN, rng.standard_normal(6)), dtype=float)
    return np.array(so3.matrix(pose[:4]), dtype=float), pose[4:]


class Loop:
    """A cut joint between two moving links, the second of them fitted so that the joint is closed."""

    def __init__(self, name, seed, opened=0.0):
        code, size, basis = JOINTS[name]
        rng, dim = np.random.default_rng(seed), basis.shape[1]
        self.normal = np.linalg.svd(basis.T)[2][dim:] if dim else np.eye(6)
        self.element = np.array([1.0, 0.0, 0.0, 0.0]) if code == codes.SO3 else rng.uniform(-1.0, 1.0, size)
        if code == codes.SO3:
            self.element = np.array(so3.exp(PLAIN, rng.standard_normal(3)), dtype=float)
        numbers = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
        numbers[0][:, :dim] = basis
        numbers[1][:dim] = np.linalg.pinv(basis) if dim else np.zeros((0, 6))
        numbers[2][: len(self.normal)] = self.normal
        self.inner, self.outer = frame(rng), frame(rng)
        real = np.concatenate([*(x.ravel() for x in (*self.inner, *self.outer, *numbers)), [0.0]])
        whole = np.array([0, 1, code, dim, 0, size, 0, 0, len(self.normal), 0], dtype=np.int64)
        self.cut, self.numbers = whole, real
        self.chart = np.array([code, dim, 0, size, 0, 0, 0], dtype=np.int64)
        near = frame(rng)
        # far = near · inner · joint · gap · outer⁻¹
        joint = self.frame_of(code, basis)
        gap = np.array(se3.exp(PLAIN, opened * rng.standard_normal(6)), dtype=float)
        far = compose(
            near, self.inner, joint, (np.array(so3.matrix(gap[:4]), dtype=float), gap[4:]), inverse(self.outer)
        )
        self.places = np.zeros((3, LinkPlace.real_width))
        for row, (turn, at) in zip(self.places, (near, far), strict=False):
            row[:9], row[9:12], row[12:24] = turn.ravel(), at, rng.standard_normal(12)
        self.motions, self.value = np.zeros((1, Relative.real_width)), np.zeros((len(self.normal), 4))
        self.covector = np.zeros((2 * len(self.normal), 6))
        self.end = np.arange(2 * len(self.normal))

    def frame_of(self, code, basis):
        if code == codes.SO3:
            return np.array(so3.matrix(self.element), dtype=float), np.zeros(3)
        if code == codes.SE2:
            c, s = np.cos(self.element[0]), np.sin(self.element[0])
            return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([*self.element[1:], 0.0])
        pose = np.array(se3.exp(PLAIN, list(basis @ self.element)), dtype=float)
        return np.array(so3.matrix(pose[:4]), dtype=float), pose[4:]

    def found(self):
        RUN["rows"](self.cut, self.numbers, self.places, self.motions, self.end, self.value, self.covector)
        RUN["poses"](self.cut, self.numbers, self.places, self.motions)
        return self

    def moved(self, h):
        """A copy after h seconds at the links' twists, which change in the links' axes by their biases."""
        other = object.__new__(Loop)
        other.__dict__ = {key: x.copy() if isinstance(x, np.ndarray) else x for key, x in self.__dict__.items()}
        other.covector[:] = 0.0
        for row in other.places[:2]:
            own, change = turned(row[:9].reshape(3, 3).T, row[12:18]), turned(row[:9].reshape(3, 3).T, row[18:24])
            pose = np.array(se3.exp(PLAIN, list(h * (own + 0.5 * h * change))), dtype=float)
            turn, at = compose(
                (row[:9].reshape(3, 3), row[9:12]), (np.array(so3.matrix(pose[:4]), dtype=float), pose[4:])
            )
            row[:9], row[9:12], row[12:18] = turn.ravel(), at, turned(turn, own + h * change)
        return other


def compose(*frames):
    turn, at = np.eye(3), np.zeros(3)
    for other, place in frames:
        turn, at = turn @ other, at + turn @ place
    return turn, at


def turned(turn, twist):
    return np.concatenate([turn @ twist[:3], turn @ twist[3:]])


def inverse(frame):
    return frame[0].T, -frame[0].T @ frame[1]


drawn = given(name=st.sampled_from(sorted(JOINTS)), seed=seeds)
some = settings(max_examples=25)
STEP = 1e-4
"""Differences are of order two: their error is STEP² times third derivatives, and rounding over STEP."""
CLOSE = 1e3 * STEP**2


@drawn
@some
def test_rows_make_the_power_of_the_forbidden_twists(name, seed):
    loop = Loop(name, seed).found()
    twist = loop.motions[0, 19:25]
    for a, normal in enumerate(loop.normal):
        power = loop.covector[2 * a] @ loop.places[0, 12:18] + loop.covector[2 * a + 1] @ loop.places[1, 12:18]
        assert power == pytest.approx(normal @ twist, abs=1e-13 * largest(loop.covector) * 10.0)


@drawn
@some
def test_what_is_open_changes_by_the_forbidden_twists_and_these_by_the_targets(name, seed):
    loop = Loop(name, seed)
    worst, gaps, rates = np.zeros(1), [], []
    for h in (-STEP, STEP):
        other = loop.moved(h).found()
        RUN["fit"](other.cut, other.numbers, other.motions, other.element)
        RUN["gaps"](other.cut, other.numbers, other.motions, other.element, other.value, worst)
        gaps.append(-other.value[:, 0])
        RUN["relative_rates"](other.cut, other.numbers, other.motions, other.value)
        rates.append(-other.value[:, 0])
    here = loop.found()
    size = 1.0 + largest(here.places) ** 3
    assert largest((rates[1] - rates[0]) / (2.0 * STEP) + here.value[:, 0], initial=0.0) <= CLOSE * size
    RUN["relative_rates"](here.cut, here.numbers, here.motions, here.value)
    # What fits to the bodies is along the joint's own freedoms, of whose groups these rows are the complement.
    found = (gaps[1] - gaps[0]) / (2.0 * STEP)
    assert largest(found + here.value[:, 0], initial=0.0) <= CLOSE * size


@drawn
@some
def test_a_closed_joint_is_fitted_to_its_element(name, seed):
    loop = Loop(name, seed).found()
    wanted, worst = loop.element.copy(), np.zeros(1)
    loop.element[:] = np.array([1.0, 0.0, 0.0, 0.0]) if JOINTS[name][0] == codes.SO3 else 0.9 * wanted
    RUN["fit"](loop.cut, loop.numbers, loop.motions, loop.element)
    RUN["gaps"](loop.cut, loop.numbers, loop.motions, loop.element, loop.value, worst)
    assert worst[0] <= 1e-13
    sign = np.sign(wanted @ loop.element) if JOINTS[name][0] == codes.SO3 else 1.0
    assert largest(sign * loop.element - wanted, initial=0.0) <= 1e-9
    wide = Loop(name, seed, opened=0.1).found()
    RUN["gaps"](wide.cut, wide.numbers, wide.motions, wide.element, wide.value, worst)
    assert worst[0] > 1e-6


@drawn
@some
def test_elements_move_as_their_velocities_say(name, seed):
    loop = Loop(name, seed).found()
    dim = JOINTS[name][2].shape[1]
    v = 0.3 * np.random.default_rng(seed).standard_normal(dim)
    out, at = np.zeros(dim), np.zeros(loop.element.size)
    RUN["velocities"](loop.chart, loop.cut, loop.numbers, loop.motions, v, np.zeros(0), out)
    RUN["advance"](loop.chart, loop.element, v, at)
    # along v + h v̇ the element moves by h r on its right, r = B⁺ u
    rates = (np.linalg.pinv(JOINTS[name][2]) if dim else np.zeros((0, 6))) @ loop.motions[0, 19:25]
    ends = []
    for h in (-STEP, STEP):
        ends.append(np.zeros(at.size))
        RUN["advance"](loop.chart, loop.element, v + h * out, ends[-1])
        direct = at.copy()
        RUN["move"](loop.chart, h * rates, direct)
        ends[-1] -= direct
    assert largest((ends[1] - ends[0]) / (2.0 * STEP), initial=0.0) <= CLOSE * (1.0 + largest(rates, initial=0.0) ** 3)


def test_the_memory_of_a_link_begins_with_its_place():
    """Rows of `LinkState` are read as `LinkPlace`: the same fields at the same offsets."""
    fields = [name for name, field in vars(LinkPlace).items() if hasattr(field, "offset")]
    assert fields == ["turn", "at", "twist", "bias", "change"]
    for name in fields:
        one, other = vars(LinkPlace)[name], vars(LinkState)[name]
        assert (one.offset, one.shape) == (other.offset, other.shape)
    assert LinkPlace.real_width == vars(LinkState)["down"].offset


@pytest.mark.parametrize("name", ["slider-crank", "universal"])
def test_loops_that_are_a_little_open_are_closed_by_their_own_rows(name):
    """With joints of several freedoms in the tree; what does not converge so is closed with more care."""
    eq = equations_of(shipped(name))
    state, moved = eq.start(0.0), np.zeros(eq.nv)
    moved[: eq.n] = 1e-3 * np.random.default_rng(1).standard_normal(eq.n)
    apart = replace(state, q=eq.advance(state.q, moved))
    found = eq.closed(apart)
    assert largest(eq.dense.gaps(found.q, found.r)[0]) <= 1e-12 and not eq.careful
    assert largest(eq.dense.gaps(apart.q, apart.r)[0]) > 1e-5
