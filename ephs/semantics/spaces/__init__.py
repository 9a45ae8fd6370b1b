"""Spaces of states: vector spaces and Lie groups, the lower pairs as subgroups of SE(3).

NumPy reference here; formulas over numbers of any kind in `staged_groups`.
"""

from ephs.semantics.spaces.errors import SpaceError as SpaceError
from ephs.semantics.spaces.groups import SE2 as SE2
from ephs.semantics.spaces.groups import SE3 as SE3
from ephs.semantics.spaces.groups import SO3 as SO3
from ephs.semantics.spaces.groups import SO3xR3 as SO3xR3
from ephs.semantics.spaces.groups import translation as translation
from ephs.semantics.spaces.groups import vector_space as vector_space
from ephs.semantics.spaces.manifold import Manifold as Manifold
from ephs.semantics.spaces.manifold import manifold as manifold
from ephs.semantics.spaces.manifold import register_manifold as register_manifold
from ephs.semantics.spaces.material import covector_of_gradient as covector_of_gradient
from ephs.semantics.spaces.material import material_covector as material_covector
from ephs.semantics.spaces.material import material_velocity as material_velocity
from ephs.semantics.spaces.material import twist_of_velocity as twist_of_velocity
from ephs.semantics.spaces.pairs import PAIRS as PAIRS
from ephs.semantics.spaces.pairs import Pair as Pair
from ephs.semantics.spaces.pairs import PairEntry as PairEntry
from ephs.semantics.spaces.pairs import pair as pair
from ephs.semantics.spaces.pairs import register_pair as register_pair
