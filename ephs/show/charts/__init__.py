"""Charts of measurements: speed against accuracy, and where which method fails."""

from ephs.show.charts.draw import draw_stability as draw_stability
from ephs.show.charts.draw import draw_work_precision as draw_work_precision
from ephs.show.charts.draw import write_cells as write_cells
from ephs.show.charts.families import FAMILIES as FAMILIES
from ephs.show.charts.families import Family as Family
from ephs.show.charts.measure import Point as Point
from ephs.show.charts.measure import work_precision as work_precision
from ephs.show.charts.outcomes import SILENT as SILENT
from ephs.show.charts.outcomes import ChartOutcome as ChartOutcome
from ephs.show.charts.reference import ReferenceMotion as ReferenceMotion
from ephs.show.charts.reference import shipped_reference as shipped_reference
from ephs.show.charts.reference import tight_reference as tight_reference
from ephs.show.charts.stability import Cell as Cell
from ephs.show.charts.stability import stability as stability

__all__ = [
    "FAMILIES",
    "SILENT",
    "Cell",
    "ChartOutcome",
    "Family",
    "Point",
    "ReferenceMotion",
    "draw_stability",
    "draw_work_precision",
    "shipped_reference",
    "stability",
    "tight_reference",
    "work_precision",
    "write_cells",
]
