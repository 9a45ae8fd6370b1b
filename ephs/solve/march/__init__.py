"""Runge-Kutta steps, explicit, implicit or semi-implicit, as staged functions, many in one call."""

from ephs.solve.march.account import RunAccount as RunAccount
from ephs.solve.march.evaluating import MarchStep as MarchStep
from ephs.solve.march.march import march as march
from ephs.solve.march.memory import Memory as Memory
from ephs.solve.march.memory import Totals as Totals
from ephs.solve.march.records import Ending as Ending
from ephs.solve.march.records import MarchControl as MarchControl
from ephs.solve.march.records import Motion as Motion
from ephs.solve.march.records import Status as Status
from ephs.solve.march.records import TableauRecord as TableauRecord
from ephs.solve.march.steps import STEPS as STEPS
from ephs.solve.march.stiff import Newton as Newton
from ephs.solve.march.stiff import Stiff as Stiff
