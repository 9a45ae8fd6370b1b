"""Points of interest on bodies."""

from typing import final

from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.schema_numbers import Text, Vector
from ephs.mechanics.scene.site import Site


@final
class Marker(Element, section="markers", said="points on bodies"):
    """A point of interest."""

    body: Text = key('the body that carries it, or "ground"', names="body")
    at: Vector = key("point in its centre-of-mass frame (ground: world)", [0.0, 0.0, 0.0], unit="m", frame="body")

    def build(self, site: Site) -> None:
        """Nothing: motions have its position, and runs a force on it as a signal."""
