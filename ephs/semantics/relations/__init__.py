"""Relations, the semantics of systems over the states of their base, by two constructions; relations of patterns."""

from ephs.semantics.relations.base import StateClass as StateClass
from ephs.semantics.relations.linear import LinearRelation as LinearRelation
from ephs.semantics.relations.linear import compose_linear as compose_linear
from ephs.semantics.relations.pattern import pattern_relation as pattern_relation
from ephs.semantics.relations.relation import Relation as Relation
from ephs.semantics.relations.relation import Route as Route
from ephs.semantics.relations.relation import relation_of as relation_of
