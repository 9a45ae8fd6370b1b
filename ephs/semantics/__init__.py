"""Semantics of patterns and systems: relations, primitives, systems, and the library of scalar physics."""

from ephs.semantics.bundles.bundle import Reference as Reference
from ephs.semantics.bundles.errors import AssemblyError as AssemblyError
from ephs.semantics.bundles.errors import SemanticsError as SemanticsError
from ephs.semantics.bundles.errors import StructureError as StructureError
from ephs.semantics.meaning import Relation as Relation
from ephs.semantics.primitives.primitives import Irreversible as Irreversible
from ephs.semantics.primitives.primitives import Reversible as Reversible
from ephs.semantics.primitives.primitives import Storage as Storage
from ephs.semantics.systems.system import System as System
