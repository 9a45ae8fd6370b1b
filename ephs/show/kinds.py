"""`plot`: every picture of a solution by its name."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ephs.mechanics.scene.errors import did_you_mean
from ephs.show.beside import plot_mechanism
from ephs.show.plots.chosen import plot_signals
from ephs.show.plots.curves import plot_constraints, plot_energy, plot_entropy, plot_exergy, plot_motion
from ephs.show.plots.efforts import plot_wrenches
from ephs.show.plots.flows import plot_exergy_flow
from ephs.show.plots.portraits import plot_phase
from ephs.show.shared.errors import ShowError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS: "dict[str, Callable[..., Figure]]" = {
    "motion": plot_motion,
    "phase": plot_phase,
    "energy": plot_energy,
    "exergy": plot_exergy,
    "entropy": plot_entropy,
    "flow": plot_exergy_flow,
    "constraints": plot_constraints,
    "wrenches": plot_wrenches,
    "mechanism": plot_mechanism,
    "signals": plot_signals,
}


def plot(sol: Any, kind: str = "motion", *arguments: Any, **options: Any) -> "Figure":
    """A picture of a solution.

    Parameters
    ----------
    kind : str
        One of `KINDS`; what else is given goes to its function.

    Raises
    ------
    ShowError
        There is no such kind, or the solution has nothing of it.
    """
    if kind not in KINDS:
        hint = did_you_mean(kind, KINDS, "choose one of these")
        raise ShowError("plot", found=kind, expected=", ".join(KINDS), path=hint)
    return KINDS[kind](sol, *arguments, **options)
