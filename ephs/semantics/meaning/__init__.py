"""The meaning of patterns and systems: relations between named variables over the states of their base."""

from ephs.semantics.meaning.base import StateClass as StateClass
from ephs.semantics.meaning.functor import glued as glued
from ephs.semantics.meaning.functor import relation_of_pattern as relation_of_pattern
from ephs.semantics.meaning.linear import LinearRelation as LinearRelation
from ephs.semantics.meaning.relation import Instant as Instant
from ephs.semantics.meaning.relation import Relation as Relation
from ephs.semantics.meaning.relation import Route as Route
from ephs.semantics.meaning.relation import relation_of as relation_of
