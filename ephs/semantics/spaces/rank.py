"""Rank and zero: the thresholds for zero singular values, pivots and remainders, each with its reason.

Every threshold is a part of the largest value of its kind, so that no unit enters it. Rank is decided on rows scaled to
comparable terms, constraints in the mass metric, and never on a product of a matrix with its transpose, which squares
singular values.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

ASSEMBLY = 1e-8
"""Tolerance of assembly, as a part of the mechanism's length: files written with nine digits round by less, and no
mechanism is made more exactly. Angles in rad and twists of size one are held to it, too."""
GAP = 1e-15
"""Gap to which loops are closed where rounding lets them, in m and rad: that of positions of size one."""
CLOSED = ASSEMBLY
"""Gap above which a state of a loop of full rank is refused; the audit applies the same limit to runs."""
CLOSED_SINGULAR = 1e-10
"""The same where rank is nearly lost. There joints open with the square of a motion, so that 1e-8 would let two bars in
line between fixed pins fall by 1e-4 of their length, and more with every step."""
ELIMINATION = 1e-10
"""Rank of relations and of linear equations between states: after a few orthogonal eliminations of condition up to 1e5
rounding is 10 κ ε, a tenth of this at most."""
CONSTRAINT = 1e-9
"""Rank of joint equations: assembled positions close to a hundredth of `ASSEMBLY`, and dependent equations differ by
no more; a larger difference makes an independent equation."""
IMPLICIT = 1e-12
"""Rank in an implicit step, which stays accurate with constraints that are nearly dependent, and errs where one is
left out: with 1e-9 two four-bars pass alignment with a gap of 6e-7, with 1e-13 to rounding."""
FOLLOWED = 1e-8
"""The same in later steps, of as many equations as were dependent before: structural dependences are inexact by the
accumulated rounding of omitted joints, and multipliers against it would grow without bound."""
EXPLICIT = 1e-4
"""Rank in explicit steps, in the mass metric and without masses. Generous, since multipliers grow like its inverse near
alignment: measured on a four-bar through three alignments, errors are 2e-9 with 1e-2, 6e-10 with 1e-3 and 1e-4, 3e-7
with 1e-6, and with 1e-8 steps diverge."""
SPARSE = 1e-5
"""Squares in the mass metric below this go from the sparse elimination, which squares, to the dense one, which decides
by `EXPLICIT`; its square is well below this, so that the sparse one never decides a rank."""
REGULAR = 1e-14
"""Rank of matrices that are regular by construction or have a known rank: only rounding counts as zero."""
ROUNDED = 1e-10
"""Size of a row beside its own terms that is rounding: sums along chains of 1e4 joints round by less."""
SPANNED = 1e-7
"""Remainder of a vector of a span after projection on a part of it: rounding over `CONSTRAINT`."""
NEIGHBOUR = 1e-6
"""Rank in neighbouring configurations, which are closed by iteration to `ASSEMBLY` only."""
LIGHT = 1e-9
"""Mass of massless bodies in a metric, relative to the heaviest body."""
TINY = 1e-300
"""Lower bound of denominators, smaller than any size: quotients stay finite."""
DIRECTION = 1e-12
"""Length below which a vector has no direction: components are written with 12 digits at most."""
ALIGNED = 1e-6
"""Sine of the angle between two directions below which they are one: a third one that both are to span is then rounding
over this, 2e-10."""
INERTIA = 1e-9
"""Part of the largest principal moment by which moments may miss positivity and the triangle inequality: those of a
thin plate or rod meet it with equality, and files are written with nine digits."""
DIFFERENCE = 1e-6
"""Step of a one-sided difference, beside 1 and the unknown: the root of rounding, over its curvature."""


def rank_of(sizes: NDArray[Any], part: float, usual: float = 0.0) -> int:
    """Number of these sizes, singular values or pivots (k,), that exceed a part of the largest and of a usual size."""
    return int(np.sum(sizes > part * max(sizes.max(), usual))) if sizes.size and sizes.max() > 0.0 else 0
