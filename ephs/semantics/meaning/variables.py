"""Variables: the numbers that a relation is between, by name.

A relation knows no order of coordinates and no offsets. What two relations call by one name is one number.
"""

from typing import Literal, NamedTuple, TypeAlias

from ephs.operad import ROOT, Path, Quantity

Role: TypeAlias = Literal["outer", "inner", "met", "own", "one"]


class RelationVariable(NamedTuple):
    """A number of a relation.

    Parameters
    ----------
    role
        ``outer`` at a port of the interface, ``inner`` at a port of an open box, ``met`` where a box is being filled,
        or known inside a component only; ``own`` inside and named for good by
        its full path, such as the rate of a state; ``one`` is the constant 1, which makes affine relations linear.
    kind
        ``flow``, ``effort``, ``rate`` and others.
    box
        Box or component; the root at the interface.
    port
        Port of the box, the component or the interface.
    place
        Place in the port's vector.
    """

    role: Role
    kind: str
    box: Path
    port: Path
    place: int

    @property
    def path(self) -> Path:
        """Full path of the port."""
        return self.box / self.port

    def __str__(self) -> str:
        return "1" if self.role == "one" else f"{self.kind} {self.path}" + (f"[{self.place}]" if self.place else "")


ONE = RelationVariable("one", "one", ROOT, ROOT, 0)


def at_port(role: Role, kind: str, port: Path, quantity: Quantity, box: Path = ROOT) -> list[RelationVariable]:
    """The variables of a vector at a port, in the port's order."""
    return [RelationVariable(role, kind, box, port, i) for i in range(quantity.space.dim)]


def own(kind: str, path: Path, size: int) -> list[RelationVariable]:
    """The variables of a vector inside, named for good by a full path."""
    return [RelationVariable("own", kind, ROOT, path, i) for i in range(size)]


def into(box: Path, variable: RelationVariable) -> RelationVariable:
    """The name that a variable of what fills a box has in the whole: its interface meets that of the box."""
    role, kind, inside, port, place = variable
    if role == "outer":
        return RelationVariable("met", kind, box, port, place)
    return RelationVariable(role, kind, box / inside, port, place) if role in ("inner", "met") else variable
