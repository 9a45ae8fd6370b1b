"""The one error of this layer, and all of its texts."""

from typing import final

_TEXTS = {
    "suffix": (
        "cannot save a drawing as {found!r}: expected a file name ending in .svg, .tex or .png; "
        "rename the file, or write drawing.svg or drawing.tikz yourself"
    ),
    "kind": ("box {path}: found kind {found!r}, expected one of {expected}; correct the entry in kinds="),
    "stranger": (
        "positions: found {found!r}, expected a box or junction of the pattern ({expected}); correct the name"
    ),
    "unplaced": "positions: box {path} has none; expected a point (x, y) for every box; add it, or give no positions",
    "coincide": (
        "positions: {path} and {found} are at the same point; expected different points for all boxes and junctions; "
        "move one of them"
    ),
    "scene": (
        "solution {path}: found no scene, expected bodies to animate; "
        "only solutions of a Scene can be animated, plot() draws the states of any other"
    ),
    "viser": (
        "animation: the package viser is not installed; expected it for moving pictures; "
        "install it with: pip install 'ephs[viz]'"
    ),
    "ledger": "solution {path}: found no {found}, expected {expected}; draw the states with plot_motion instead",
    "span": "animation: found {path} = {found}, expected a number of at least {expected}; give a larger one",
    "shape": (
        "body {path}: found shape {found}, expected one of box = [x, y, z], sphere = r, cylinder = [radius, length], "
        "mesh = FILE; correct its shape"
    ),
}


@final
class ShowError(ValueError):
    """Something cannot be drawn as it was asked for.

    Parameters
    ----------
    case : str
        Which of the faults of this layer it is.
    path, found, expected : str
        Where it is, what was found there and what was expected.
    """

    def __init__(self, case: str, *, path: str = "", found: str = "", expected: str = "") -> None:
        super().__init__(_TEXTS[case].format(path=path, found=found, expected=expected))
        self.case = case
        self.path = path
        self.found = found
        self.expected = expected
