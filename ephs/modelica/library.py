"""`ModelicaLibrary`: classes of Modelica in files and folders, of which components are read."""

from os import PathLike
from pathlib import Path
from typing import Any, final

from ephs.modelica.errors import ModelicaError
from ephs.modelica.flat import flattened, tree_of
from ephs.modelica.parts import ModelicaComponent, component_of


@final
class ModelicaLibrary:
    """Classes of Modelica, of which components are read as systems.

    Attributes
    ----------
    tree
        The syntax tree, of Pymoca.

    Parameters
    ----------
    *paths
        Files that end in ``.mo``, and folders with libraries, such as those on ``MODELICAPATH``.

    Raises
    ------
    ModelicaError
        No such file, or none of Modelica.
    """

    __slots__ = ("tree",)

    def __init__(self, *paths: str | PathLike[str]) -> None:
        self.tree: Any = tree_of(tuple(Path(path) for path in paths))

    def models(self, package: str) -> tuple[str, ...]:
        """Names of the models of a package that are not partial, in its order."""
        inside = self.tree
        for part in package.split("."):
            inside = inside.classes.get(part)
            if inside is None:
                raise ModelicaError("file", where=package)
        found = (each for each in inside.classes.values() if each.type in ("model", "block") and not each.partial)
        return tuple(f"{package}.{each.name}" for each in found)

    def read(self, name: str, /, **parameters: float) -> ModelicaComponent:
        """Read one component, with parameters of these values in SI units.

        A parameter without a value has its start value, as in Modelica. The heat port is always there.

        Raises
        ------
        ModelicaError
            The component is not taken: what cannot be read, or violates a law, and its equation.
        """
        return component_of(flattened(self.tree, name, parameters))
