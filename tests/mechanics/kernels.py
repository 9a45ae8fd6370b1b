"""Kernels called as the solver calls them, beside the plain definitions of their primitives."""

import ctypes

import numpy as np

from ephs.semantics import Reference, Storage
from ephs.semantics.descriptor.kernel_table import OK, address_of, prototype
from ephs.semantics.descriptor.sparsity import jacobian_mask
from ephs.semantics.primitives.behaviour import NaturalBehaviour
from ephs.semantics.verdicts.checks import random_efforts, random_point
from tests import numerics
from tests.numerics import largest

REFERENCE = Reference()
POINTER = ctypes.POINTER(ctypes.c_double)


class Draw:
    """Random arguments of a discrete relation."""

    def __init__(self, primitive, seed, size):
        rng = np.random.default_rng(seed)
        self.primitive, self.h = primitive, 10.0 ** rng.uniform(-4.0, -1.0)
        self.n = primitive.bundle.size
        self.k = getattr(primitive, "multipliers", 0)
        dims = [primitive.interface[p].quantity.space.dim for p in primitive.reads]
        self.x = random_point(primitive.bundle, primitive.reads, rng)
        for value in self.x.values():  # rotations of half a turn have two logarithms: keep off
            if value.size in (4, 7) and abs(value[0]) < 0.3:
                value[0] = 1.0
                value[:4] /= np.linalg.norm(value[:4])
        self.v = size * rng.standard_normal(sum(dims))
        self.e, self.lam = random_efforts(primitive.bundle, rng), rng.standard_normal(self.k)
        self.splits = np.cumsum(dims)[:-1]

    def steps(self, v):
        return dict(zip(self.primitive.reads, np.split(v, self.splits), strict=True)) if self.primitive.reads else {}

    def plain(self, z):
        """The oracle at z = (e, λ, v), or at v for a storage."""
        if isinstance(self.primitive, Storage):
            return self.primitive.discrete_effort(self.x, z, REFERENCE)
        local = NaturalBehaviour(REFERENCE, self.h).behaviour(self.primitive, self.x)
        rates = {p: v / self.h for p, v in self.steps(z[self.n + self.k :]).items()}
        return np.concatenate(local.relate(z[: self.n], z[self.n : self.n + self.k], rates))

    @property
    def z(self):
        return self.v if isinstance(self.primitive, Storage) else np.concatenate([self.e, self.lam, self.v])

    def compiled(self):
        """Status, values, Jacobian, and a storage's energy, of the kernel."""
        address, numbers, _ = address_of(self.primitive)
        n, k, m = self.n, self.k, self.v.size
        x = np.concatenate([*(self.x[p] for p in self.primitive.reads), [0.0]])
        dims = np.array([n, k, m, x.size - 1], dtype=np.int64)
        scal = np.array([self.h, REFERENCE.temperature, REFERENCE.pressure])
        arrays = [scal, np.array([*numbers, 0.0]), x, np.append(self.v, 0.0), np.append(self.e, 0.0)]
        arrays += [
            np.append(self.lam, 0.0),
            np.zeros(n * n + n + 1),
            np.zeros(k + 2),
            np.zeros((n + k) * (n + k + m) + 1),
            np.zeros(4096),
        ]
        status = prototype(address)(
            dims.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), *[a.ctypes.data_as(POINTER) for a in arrays]
        )
        if isinstance(self.primitive, Storage):
            return status, arrays[4][:n], arrays[6][: n * n].reshape(n, n), arrays[7][0]
        width = n + k + m
        values = np.concatenate([arrays[6][:n], arrays[7][:k]])
        return status, values, arrays[8][: (n + k) * width].reshape(n + k, width), 0.0


def agreeing(draw, near=3e-6):
    """The energy of a kernel, whose values are the plain ones, and its Jacobian their differences, 0 off its mask.

    Differences, and the differenced slopes of springs, are good to about eight digits: ``near`` of the largest.
    """
    expected = draw.plain(draw.z)
    status, values, jacobian, energy = draw.compiled()
    assert status == OK
    assert largest(values - expected, initial=0.0) <= 2e-13 * max(1.0, largest(expected, initial=0.0))
    differences = numerics.jacobian(lambda v: draw.plain(draw.z + v), draw.z.size, 1e-5).reshape(jacobian.shape)
    assert not jacobian[~jacobian_mask(draw.primitive)].any()
    assert largest(jacobian - differences, initial=0.0) <= near * max(1.0, largest(differences, initial=0.0))
    return energy
