"""Groups of edges of which none acts where two points are far from each other: tests that many share."""

from ephs.semantics.stage import Record, integer, real, reals


class Middle(Record):
    """A point of a link, −1: the ground, and a direction there, along which planes are above."""

    link = integer()
    at = reals(3)
    axis = reals(3)


class Group(Record):
    """Consecutive edges between the same links, of which none acts where two points are far from each other.

    Attributes
    ----------
    support, spread
        `ABOVE` or `BEYOND`: where the second point is higher above the first, or farther from it, none acts; else 0.
    start, end
        Numbers of the edges.
    one, two
        The points, of the first and of the second link.
    """

    support = integer()
    start = integer()
    end = integer()
    one = integer()
    two = integer()
    spread = real()
