"""References to cite for a run: entries of the packaged bibliography, by the method and the form used."""

import re
from collections.abc import Mapping
from importlib.resources import files
from types import MappingProxyType

from ephs.solve.result.solution import Solution

ALWAYS = ("ephs", "LohmayerCapobiancoLeyendecker2024", "LohmayerLynchLeyendecker2024")
"""The program and the theory of its models."""
METHOD_SOURCES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "natural": ("Gonzalez1996", "McLachlanQuispelRobidoux1999"),
        "natural4": ("Gonzalez1996", "McLachlanQuispelRobidoux1999", "HairerLubichRoche1989"),
        "variational": ("MarsdenWest2001",),
        "radau": ("HairerWanner1996",),
        "rk54": ("DormandPrince1980",),
        "rk87": ("PrinceDormand1981", "HairerNorsettWanner1993"),
        "semi": ("PareschiRusso2005", "BoscarinoFilbetRusso2016"),
    }
)
"""Keys in ``references.bib`` of each method's sources."""
FORM_SOURCES: Mapping[str, tuple[str, ...]] = MappingProxyType({"reduced": ("Featherstone2008",)})
"""The same of the forms of the equations."""

_ENTRY = re.compile(r"^@\w+\{([^,\s]+),\n.*?^\}$", re.MULTILINE | re.DOTALL)


def bibliography() -> dict[str, str]:
    """The BibTeX entries of ``references.bib`` by key, in the file's order."""
    text = files("ephs.mechanics").joinpath("references.bib").read_text(encoding="utf-8")
    return {entry.group(1): entry.group(0) for entry in _ENTRY.finditer(text)}


def cite(solution: Solution) -> str:
    """BibTeX of a run: program, theory, method, form of the equations.

    Parameters
    ----------
    solution
        Result of `ephs.simulate` or `ephs.load_solution`. If ``auto`` changed to another method, both are cited.

    Returns
    -------
    str
        Entries separated by empty lines. Methods of your own add none.
    """
    stats = solution.stats
    used = [*ALWAYS]
    for method in str(stats.get("method")).split(", "):
        used += METHOD_SOURCES.get(method, ())
    used += FORM_SOURCES.get(str(stats.get("form")), ())
    entries = bibliography()
    return "\n\n".join(entries[key] for key in dict.fromkeys(used)) + "\n"
