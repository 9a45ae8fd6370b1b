"""Explicit Runge-Kutta steps as staged functions, many in one call."""

from ephs.mechanics.solve.march.march import march as march
from ephs.mechanics.solve.march.records import Control as Control
from ephs.mechanics.solve.march.records import Ending as Ending
from ephs.mechanics.solve.march.records import Field as Field
from ephs.mechanics.solve.march.records import Memory as Memory
from ephs.mechanics.solve.march.records import Motion as Motion
from ephs.mechanics.solve.march.records import Status as Status
from ephs.mechanics.solve.march.records import Tableau as Tableau
