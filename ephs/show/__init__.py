"""Pictures of patterns, motions and ledgers, which notebooks show by themselves.

matplotlib, drawsvg, Graphviz and viser are imported where they are used, not here.
"""

from ephs.show.animation import animate as animate
from ephs.show.beside import plot_mechanism as plot_mechanism
from ephs.show.chosen import plot_signals as plot_signals
from ephs.show.drawing import Drawing as Drawing
from ephs.show.drawing import draw as draw
from ephs.show.efforts import plot_wrenches as plot_wrenches
from ephs.show.errors import ShowError as ShowError
from ephs.show.flows import plot_exergy_flow as plot_exergy_flow
from ephs.show.geometry import Placement as Placement
from ephs.show.kinds import plot as plot
from ephs.show.layout import place as place
from ephs.show.page import Page as Page
from ephs.show.plots import plot_constraints as plot_constraints
from ephs.show.plots import plot_energy as plot_energy
from ephs.show.plots import plot_entropy as plot_entropy
from ephs.show.plots import plot_exergy as plot_exergy
from ephs.show.plots import plot_motion as plot_motion
from ephs.show.portraits import plot_phase as plot_phase
from ephs.show.report import write_report as write_report
from ephs.show.video import write_video as write_video

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
