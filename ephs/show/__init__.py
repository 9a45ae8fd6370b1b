"""Pictures of patterns, motions and ledgers, which notebooks show by themselves.

matplotlib, drawsvg and viser are imported where they are used, not here.
"""

from ephs.show.beside import plot_mechanism as plot_mechanism
from ephs.show.diagrams.drawing import Drawing as Drawing
from ephs.show.diagrams.drawing import draw as draw
from ephs.show.diagrams.geometry import Placement as Placement
from ephs.show.diagrams.layout import place as place
from ephs.show.kinds import plot as plot
from ephs.show.motions.animation import animate as animate
from ephs.show.motions.video import write_video as write_video
from ephs.show.plots.chosen import plot_signals as plot_signals
from ephs.show.plots.curves import plot_constraints as plot_constraints
from ephs.show.plots.curves import plot_energy as plot_energy
from ephs.show.plots.curves import plot_entropy as plot_entropy
from ephs.show.plots.curves import plot_exergy as plot_exergy
from ephs.show.plots.curves import plot_motion as plot_motion
from ephs.show.plots.efforts import plot_wrenches as plot_wrenches
from ephs.show.plots.flows import plot_exergy_flow as plot_exergy_flow
from ephs.show.plots.portraits import plot_phase as plot_phase
from ephs.show.report import write_report as write_report
from ephs.show.shared.errors import ShowError as ShowError
from ephs.show.shared.page import Page as Page

__all__ = [
    "Drawing",
    "Page",
    "Placement",
    "ShowError",
    "animate",
    "draw",
    "place",
    "plot",
    "plot_constraints",
    "plot_energy",
    "plot_entropy",
    "plot_exergy",
    "plot_exergy_flow",
    "plot_mechanism",
    "plot_motion",
    "plot_phase",
    "plot_signals",
    "plot_wrenches",
    "write_report",
    "write_video",
]
