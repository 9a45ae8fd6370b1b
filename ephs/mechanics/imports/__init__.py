"""Models in other formats: URDF, MJCF and SDF, read into the tables of a scene file.

A reader makes the same tables as `tomllib` makes of a scene file; what follows is the same for both, and a model can be
written as a scene file. MuJoCo is needed for MJCF only.
"""

from ephs.mechanics.imports.convert import convert as convert
from ephs.mechanics.imports.read import read_model as read_model
