"""Plots of chosen signals: ``joints.bearing.rate``, ``bodies.rod.position.x``, ``energy``."""

from typing import TYPE_CHECKING, Any

from ephs.mechanics.sweep.outputs import TOTALS, Output, known_outputs, made_by_hand, unknown_output
from ephs.show.plots.curves import panel_figure
from ephs.show.plots.panels import Curve, Panel
from ephs.show.plots.series import Array
from ephs.show.shared.palette import CYCLE
from ephs.solve.result.labels import Labels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIRST = {"joints": "coordinate", "bodies": "position", "markers": "position", "thermal": "temperature"}
"""Default quantity of a joint, body, marker or thermal node."""


def signal_names(sol: Any) -> dict[str, Labels]:
    """Names of all signals of a solution, with the names and units of their components."""
    model = sol.scene or sol.system
    if model is not None:
        return made_by_hand(sol) | known_outputs(model)
    ledgers = {name: Labels("", (), (unit,)) for name, unit in TOTALS.items()}
    return ledgers | {str(path): sol.labels[path] for path in sol.states}


def plot_signals(sol: Any, *names: str) -> "Figure":
    """Chosen signals over time, one panel for each quantity and unit.

    Parameters
    ----------
    names : str
        Outputs as `signal_names` lists them; the name of a joint, body, marker or thermal node alone stands for its
        coordinate, position or temperature, and a further ``.x`` takes one component. Without names: coordinates of
        all joints; positions of all bodies where there are no joints; else energies.

    Raises
    ------
    OptionError
        There is no such signal; the nearest name of the same kind is told.
    """
    known = signal_names(sol)
    lines: dict[str, list[tuple[str, Array]]] = {}
    for name in names or _usual(known):
        output, component = _output_of(name, known)
        labels = known[output]
        values = Output(output, labels).read(sol).reshape(len(sol.t), -1)
        for k, column in enumerate(values.T):
            part = labels.names[k] if len(values.T) > 1 else ""
            if component not in ("", part):
                continue
            what = output.rpartition(".")[2] if output.partition(".")[0] in _FIRST else output
            title = f"{what.replace('_', ' ')} [{labels.units[k]}]"
            lines.setdefault(title, []).append((f"{output.rpartition('.')[0] or output} {part}".strip(), column))
    panels = [
        Panel(title, tuple(Curve(name, values, CYCLE[k % len(CYCLE)]) for k, (name, values) in enumerate(found)))
        for title, found in lines.items()
    ]
    return panel_figure(sol, "signals", panels)


def _usual(known: dict[str, Labels]) -> list[str]:
    """Default outputs."""
    for kind, quantity in _FIRST.items():
        if found := [name for name in known if name.startswith(f"{kind}.") and name.endswith(f".{quantity}")]:
            return found
    return [name for name in known if name in TOTALS]


def _output_of(name: str, known: dict[str, Labels]) -> tuple[str, str]:
    """Output of a name, and its component, if any."""
    outer, _, last = name.rpartition(".")
    for output in (name, f"{name}.{_FIRST.get(name.partition('.')[0], '')}"):
        if output in known:
            return output, ""
    if outer in known and last in known[outer].names:
        return outer, last
    raise unknown_output("signal", name, known)
