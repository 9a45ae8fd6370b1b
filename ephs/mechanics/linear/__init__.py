"""Models linearised about a state, with their energy and dissipation; equilibria."""

from ephs.mechanics.linear.equilibrium import Equilibrium as Equilibrium
from ephs.mechanics.linear.equilibrium import equilibrium as equilibrium
from ephs.mechanics.linear.linearize import linearize as linearize
from ephs.mechanics.linear.modes import Mode as Mode
from ephs.mechanics.linear.statespace import StateSpace as StateSpace
from ephs.mechanics.linear.structure import PortHamiltonian as PortHamiltonian
