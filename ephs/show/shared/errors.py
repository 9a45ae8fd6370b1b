"""Exception of pictures, and its messages."""

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
    "far": "positions: {path} is at {found}, expected finite numbers up to {expected}; give units of the grid",
    "coincide": (
        "positions: {path} and {found} are at the same point; expected different points for all boxes and junctions; "
        "move one of them"
    ),
    "scene": ("solution {path}: found no bodies, expected some to animate; plot() draws the states"),
    "viser": (
        "animation: the package viser is not installed; expected it for moving pictures; "
        "install it with: pip install 'ephs[viz]'"
    ),
    "video": "video {found}: found another ending, expected one of {expected}; choose another file name",
    "ffmpeg": "video: found no program ffmpeg, which writes {found} files; install it, or choose a file ending in .gif",
    "ledger": "solution {path}: found no {found}, expected {expected}; draw the states with plot_motion instead",
    "span": "animation: found {path} = {found}, expected a number of at least {expected}; give a larger one",
    "shape": (
        "body {path}: found shape {found}, expected one of box = [x, y, z], sphere = r, cylinder = [radius, length], "
        "mesh = FILE; correct its shape"
    ),
    "colour": "colour: found {found!r}, expected one of {expected}; choose one of these",
    "plot": "plot: found kind {found!r}, expected one of {expected}; {path}",
    "nothing": "solution {path}: found no {found}, expected {expected}",
    "reference": (
        "{path}: found no method that reaches {expected} with tight tolerances, expected one for the reference "
        "({found}); shorten the time, or give a reference file"
    ),
    "doubt": (
        "{path}: found that references differ by {found} at the end, expected at most {expected}; "
        "errors are not known, shorten the time"
    ),
    "reference-time": "{path}: found no state at {found} s, expected one of the times {expected}; choose one of these",
    "reference-file": (
        "{path}: found no reference states ({found}), expected JSON with states.TIME.bodies.NAME.position and "
        ".quaternion for every body of the scene; correct the file"
    ),
}


@final
class ShowError(ValueError):
    """An invalid request of a picture or chart.

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
