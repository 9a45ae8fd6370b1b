"""What a chart cannot be measured from, and all of its texts."""

from typing import final

_TEXTS = {
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
class ChartError(ValueError):
    """A chart that cannot be measured.

    Parameters
    ----------
    case : str
        Which of the faults it is.
    path, found, expected : str
        Where it is, what was found there and what was expected.
    """

    def __init__(self, case: str, *, path: str = "", found: str = "", expected: str = "") -> None:
        super().__init__(_TEXTS[case].format(path=path, found=found, expected=expected))
        self.case, self.path, self.found, self.expected = case, path, found, expected
