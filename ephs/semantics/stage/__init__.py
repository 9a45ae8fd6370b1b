"""One function, many evaluations: functions over abstract numbers, staged to machine code."""

from ephs.semantics.stage.duals import Duals as Duals
from ephs.semantics.stage.entries import Entry as Entry
from ephs.semantics.stage.errors import StageError as StageError
from ephs.semantics.stage.evaluator import Evaluator as Evaluator
from ephs.semantics.stage.evaluator import staged as staged
from ephs.semantics.stage.kinds import indices as indices
from ephs.semantics.stage.kinds import matrix as matrix
from ephs.semantics.stage.kinds import table as table
from ephs.semantics.stage.kinds import vector as vector
from ephs.semantics.stage.memory import Integers as Integers
from ephs.semantics.stage.memory import Matrix as Matrix
from ephs.semantics.stage.memory import Variable as Variable
from ephs.semantics.stage.memory import Vector as Vector
from ephs.semantics.stage.numbers import Integer as Integer
from ephs.semantics.stage.numbers import Real as Real
from ephs.semantics.stage.numbers import Truth as Truth
from ephs.semantics.stage.plain import PLAIN as PLAIN
from ephs.semantics.stage.programs import Program as Program
from ephs.semantics.stage.records import Record as Record
from ephs.semantics.stage.records import Table as Table
from ephs.semantics.stage.records import integer as integer
from ephs.semantics.stage.records import integers as integers
from ephs.semantics.stage.records import real as real
from ephs.semantics.stage.records import reals as reals
