"""Scenes: mechanisms from files, in their initial states.

The model of a scene is light; the reader, with its schema and assembly, lies in `ephs.mechanics.scene.load`
and is imported where it is used.
"""

from ephs.mechanics.scene.adjustment import Adjustment as Adjustment
from ephs.mechanics.scene.adjustment import Displacement as Displacement
from ephs.mechanics.scene.conduction import Conduction as Conduction
from ephs.mechanics.scene.errors import Fault as Fault
from ephs.mechanics.scene.errors import ModelWarning as ModelWarning
from ephs.mechanics.scene.errors import SceneError as SceneError
from ephs.mechanics.scene.errors import SceneWarning as SceneWarning
from ephs.mechanics.scene.model import Body as Body
from ephs.mechanics.scene.model import Joint as Joint
from ephs.mechanics.scene.model import Scene as Scene
from ephs.mechanics.scene.model import World as World
from ephs.mechanics.scene.springs import Spring as Spring
from ephs.mechanics.scene.thermal import ThermalNode as ThermalNode
