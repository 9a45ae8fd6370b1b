"""Derivatives of a motion by its model's numbers and initial values; numbers fitted to recorded motions."""

from ephs.mechanics.sensitivity.adjoint import Gradient as Gradient
from ephs.mechanics.sensitivity.adjoint import gradient as gradient
from ephs.mechanics.sensitivity.fit import Fit as Fit
from ephs.mechanics.sensitivity.fit import fit as fit
from ephs.mechanics.sensitivity.sensitivity import Sensitivity as Sensitivity
from ephs.mechanics.sensitivity.sensitivity import sensitivity as sensitivity
