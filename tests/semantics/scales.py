"""Systems whose components have numbers of other sizes, from 1e-9 to 1e9: other units, stiff beside soft parts."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from ephs.operad import ROOT
from ephs.semantics import Reversible, Storage, System

LARGEST = 9
"""Largest power of ten of a factor."""


def rescaled(filling, rng):
    """A filling whose energies, L, rows of C and M have factors from 1e-9 to 1e9, one each."""
    if isinstance(filling, System):
        return System.of(filling.pattern, {box: rescaled(part, rng) for box, part in filling.fillings.items()})
    factor = 10.0 ** rng.integers(-LARGEST, LARGEST, endpoint=True)
    if isinstance(filling, Storage):
        given = filling.energy_gradient
        return replace(
            filling,
            energy=lambda x: factor * filling.energy(x),
            gradient=lambda x: factor * given(x),
            discrete_gradient=None,
            kernel=None,
            trusted=True,
        )
    if isinstance(filling, Reversible):
        rows = 10.0 ** rng.integers(-LARGEST, LARGEST, (filling.multipliers, 1), endpoint=True)

        def structure(x):
            skew, constraint = filling.structure(x)
            return factor * skew, rows * constraint

        return replace(filling, structure=structure, kernel=None, trusted=True)
    return replace(filling, matrix=lambda x, e, reference: factor * filling.matrix(x, e, reference), trusted=True)


@st.composite
def scaled(draw, of):
    """Drawn systems, rescaled."""
    return rescaled(draw(of), np.random.default_rng(draw(st.integers(0, 2**20))))


def sizes(instant):
    """Sizes of the coefficients of all equations over a point, before anything is eliminated."""
    field, point = instant.point.field, instant.point
    rows = [row for *_, row in instant.relation.fibre.labelled(ROOT, point)]
    return [abs(field.value(number)) for row in rows for number in row.values() if field.certain(number)]
