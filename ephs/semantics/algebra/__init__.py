"""Algebras of the operad of patterns, several semantics of systems, and the maps between them."""

from ephs.semantics.algebra.counts import Cost as Cost
from ephs.semantics.algebra.counts import cost as cost
from ephs.semantics.algebra.counts import counting as counting
from ephs.semantics.algebra.dimensions import Units as Units
from ephs.semantics.algebra.dimensions import units as units
from ephs.semantics.algebra.enclosures import Conductors as Conductors
from ephs.semantics.algebra.enclosures import conduction as conduction
from ephs.semantics.algebra.enclosures import intervals as intervals
from ephs.semantics.algebra.fibres import meaning_of_systems as meaning_of_systems
from ephs.semantics.algebra.fibres import relations as relations
from ephs.semantics.algebra.free import flattening as flattening
from ephs.semantics.algebra.free import meaning as meaning
from ephs.semantics.algebra.free import systems as systems
from ephs.semantics.algebra.identification import Corelation as Corelation
from ephs.semantics.algebra.identification import base as base
from ephs.semantics.algebra.identification import corelations as corelations
from ephs.semantics.algebra.rational import ExactRelation as ExactRelation
from ephs.semantics.algebra.rational import behaviour as behaviour
from ephs.semantics.algebra.rational import exact_relations as exact_relations
from ephs.semantics.algebra.rational import midpoint as midpoint
from ephs.semantics.algebra.sharers import Sharer as Sharer
from ephs.semantics.algebra.sharers import euler as euler
from ephs.semantics.algebra.sharers import resource_sharers as resource_sharers
from ephs.semantics.algebra.sharers import runge_kutta as runge_kutta
from ephs.semantics.algebra.sharers import tangent as tangent
