"""Cross-sections of beams: stiffness and inertia per length, from numbers or from a shape and a material.

Axis 1 is the tangent of the beam, axis 2 its ``up``. Shear factors: Cowper's for circles and tubes, 5/6 for rectangles.
Torsion of rectangles by Saint-Venant's series.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np
from pydantic import Field

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.schema_numbers import EntryTable, Extents, Number, Positive, Sizes, key
from ephs.semantics.bundles.bundle import Array

NUMBERS = ("EA", "GA", "GJ", "EI", "rhoA", "rhoI")
NEEDED = {"reissner": NUMBERS, "kirchhoff": ("GJ", "EI", "rhoA", "rhoI"), "string": ("rhoA",)}
"""Required numbers of each kind of rod; other numbers are optional."""
IRON = 7870.0
"""Density in kg/m³."""
MATERIAL = ("E", "nu", "rho")


class SectionEntry(EntryTable):
    """``section``: numbers, or a shape with E, nu and rho."""

    EA: Positive | None = key("axial stiffness, N", None)
    GA: Sizes | None = key("shear stiffness along axes 2 and 3, N", None)
    GJ: Positive | None = key("torsional stiffness, N m²", None)
    EI: Sizes | None = key("bending stiffness about axes 2 and 3, N m²", None)
    rhoA: Positive | None = key("mass per length, kg/m", None)
    rhoI: Extents | None = key("inertia per length about axes 1, 2, 3, kg m", None)
    circle: Positive | None = key("radius, m", None)
    tube: Sizes | None = key("outer and inner radius, m", None)
    rectangle: Sizes | None = key("width along axis 3 and height along axis 2, m", None)
    E: Positive | None = key("Young's modulus, N/m²", None)
    nu: Annotated[Number, Field(gt=-1.0, le=0.5)] | None = key("Poisson's ratio", None)
    rho: Positive | None = key("density, kg/m³", None)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Stiffness and inertia of a beam per length.

    Attributes
    ----------
    stiffness : (6,) GJ, EI2, EI3 in N m², EA, GA2, GA3 in N
    mass : ρA in kg/m
    inertia : (3,) ρI about axes 1, 2, 3, in kg m
    outline : radius of a round section, or extents along axes 2 and 3, m; for pictures
    """

    stiffness: Array
    mass: float
    inertia: Array
    outline: tuple[float, ...]


def circle(radius: float, E: float, nu: float, rho: float) -> Section:
    """Full circle; lengths in m, E in N/m², ρ in kg/m³."""
    return tube(radius, 0.0, E, nu, rho)


def tube(outer: float, inner: float, E: float, nu: float, rho: float) -> Section:
    """Ring of two radii; units as of `circle`."""
    area, second, m = np.pi * (outer**2 - inner**2), np.pi / 4.0 * (outer**4 - inner**4), inner / outer
    round_ = (1.0 + m * m) ** 2
    shear = 6.0 * (1.0 + nu) * round_ / ((7.0 + 6.0 * nu) * round_ + (20.0 + 12.0 * nu) * m * m)
    return _section(area, second, second, 2.0 * second, shear, E, nu, rho, (float(outer),))


def rectangle(b: float, h: float, E: float, nu: float, rho: float) -> Section:
    """Width b along axis 3 and height h along axis 2 (``up``); units as of `circle`."""
    long, short = max(b, h), min(b, h)
    odd = np.arange(1.0, 40.0, 2.0)
    series = float(np.sum(np.tanh(0.5 * np.pi * odd * long / short) / odd**5))
    torsion = long * short**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * short / long * series)
    return _section(b * h, h * b**3 / 12.0, b * h**3 / 12.0, torsion, 5.0 / 6.0, E, nu, rho, (float(h), float(b)))


SHAPES: Mapping[str, Callable[..., Section]] = {"circle": circle, "tube": tube, "rectangle": rectangle}


def _section(
    area: float, about2: float, about3: float, torsion: float, shear: float,
    young: float, nu: float, rho: float, outline: tuple[float, ...],
) -> Section:  # fmt: skip
    rigidity = young / (2.0 * (1.0 + nu))
    bending = [rigidity * torsion, young * about2, young * about3]
    axial = [young * area, shear * rigidity * area, shear * rigidity * area]
    inertia = rho * np.array([about2 + about3, about2, about3])
    return Section(np.array(bending + axial), float(rho * area), inertia, outline)


def resolve_section(table: Checked[SectionEntry], rod: str) -> Section | None:
    """The section of a table for a kind of rod; None, with a fault, for missing or excess keys."""
    given: Mapping[str, Any] = table.entry.model_dump(exclude_none=True)
    shapes = [name for name in given if name in SHAPES]
    if len(shapes) > 1 or (shapes and any(name in NUMBERS for name in given)):
        names = [name for name in given if name in (*SHAPES, *NUMBERS)]
        table.fault("section", found=f"{', '.join(names[:-1])} and {names[-1]}")
        return None
    needed = MATERIAL if shapes else NEEDED[rod]
    missing = [name for name in needed if name not in given]
    if missing:
        found = "an empty table" if not given else f"a table without {', '.join(missing)}"
        table.fault("section", found=found)
        return None
    spare = [name for name in given if name not in ((*MATERIAL, *shapes) if shapes else NUMBERS)]
    if spare:
        table.fault("section", spare[0])
        return None
    if not shapes:
        full = {"GJ": 0.0, "EI": [0.0, 0.0], "EA": 0.0, "GA": [0.0, 0.0], "rhoI": [0.0, 0.0, 0.0]} | given
        stiffness = np.array([full["GJ"], *full["EI"], full["EA"], *full["GA"]])
        outline = (_radius(full, rod),)
        return Section(stiffness, full["rhoA"], np.array(full["rhoI"]), outline)
    (shape,) = shapes
    sizes = np.atleast_1d(given[shape]).tolist()
    if shape == "tube" and not sizes[1] < sizes[0]:
        table.fault("tube", "tube")
        return None
    return SHAPES[shape](*sizes, **{name: given[name] for name in MATERIAL})


def _radius(given: Mapping[str, Any], rod: str) -> float:
    """Radius in m of a circle with these numbers, for pictures: of iron, where only the mass is known."""
    if rod == "reissner":
        return 2.0 * float(np.sqrt(max(given["EI"]) / given["EA"]))
    if any(given["rhoI"]):
        return 2.0 * float(np.sqrt(max(given["rhoI"][1:]) / given["rhoA"]))
    return float(np.sqrt(given["rhoA"] / (np.pi * IRON)))
