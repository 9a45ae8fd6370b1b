"""Semantics of patterns and systems: relations, primitives, systems, and the library of scalar physics."""

from ephs.semantics.bundle import Reference as Reference
from ephs.semantics.errors import AssemblyError as AssemblyError
from ephs.semantics.errors import SemanticsError as SemanticsError
from ephs.semantics.errors import StructureError as StructureError
from ephs.semantics.meaning import Relation as Relation
from ephs.semantics.primitives import Irreversible as Irreversible
from ephs.semantics.primitives import Reversible as Reversible
from ephs.semantics.primitives import Storage as Storage
from ephs.semantics.system import System as System
