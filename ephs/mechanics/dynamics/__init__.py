"""A mechanism as functions of its state: accelerations, forces, matrices, and their exact derivatives."""

from ephs.mechanics.dynamics.compiling import dynamics as dynamics
from ephs.mechanics.dynamics.control import Task as Task
from ephs.mechanics.dynamics.model import Dynamics as Dynamics
from ephs.mechanics.dynamics.results import Constraints as Constraints
from ephs.mechanics.dynamics.results import Derivatives as Derivatives
from ephs.mechanics.dynamics.results import Energies as Energies
from ephs.mechanics.dynamics.results import VelocityDerivatives as VelocityDerivatives
from ephs.mechanics.dynamics.state import State as State
from ephs.mechanics.motion.views import BodyState as BodyState
