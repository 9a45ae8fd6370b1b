"""`ephs linearize`: state space, eigenvalues and modes of a model about a state."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from ephs.cli.input import AS_GIVEN, BadInput, LoadOptions, addressed, load_model, naming, say

if TYPE_CHECKING:
    from ephs import Scene, System

_TEXTS = {
    "at": "--at {found}: expected a number of seconds above 0, or the word equilibrium",
    "input": "--input {found}: expected names as joints.pin for a scene, PORT=effort:NUMBER or PORT=flow:NUMBER for a "
    "system",
}

linearizing = App(name="linearize", help="Linearise a model: state-space matrices, eigenvalues and modes.")


@linearizing.default
def linearize(
    scene: str,
    /,
    *,
    at: str | None = None,
    input: Annotated[list[str] | None, Parameter(name=["--input"])] = None,
    output_of: Annotated[list[str] | None, Parameter(name=["--output-of"])] = None,
    form: Literal["reduced", "paper"] = "reduced",
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Linearise a model about a state; prints eigenvalues with frequency, damping ratio and mode shape.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    at
        State: a time in seconds, up to which the model is simulated, or the word equilibrium for the state of rest
        nearest to the initial state. Default: the initial state.
    input
        Force or moment input: joints.NAME, bodies.NAME or markers.NAME of a scene; PORT=effort:NUMBER or
        PORT=flow:NUMBER of a system. May be given several times. Default: all joints; flows at all ports.
    output_of
        Output, by the same names; may be given several times. Default: the quantities power-conjugate to the inputs.
    form
        reduced: independent joint coordinates; paper: the states of the scene's system.
    output
        File for the matrices; .json, .npz (NumPy) or .nc (netCDF).
    """
    import ephs

    model = load_model(scene, loading)
    pushed: Any = _ports(input) if isinstance(model, ephs.System) and input else input
    try:
        with addressed(scene):
            here, state = _state(model, at)
            found = ephs.linearize(here, state, inputs=pushed, outputs=output_of, form=form)
    except ephs.SimulationError as error:
        raise BadInput(naming(scene, str(error))) from error
    say(str(found))
    if output is not None:
        with addressed(scene, output):
            found.save(output)
        say(f"matrices: {output}")
    return 0


def _state(model: "Scene | System", at: str | None) -> tuple[Any, Any]:
    """The model and its linearisation state."""
    import ephs

    if at is None or at == "equilibrium":
        return model, at
    try:
        time = float(at)
        if not 0.0 < time < float("inf"):
            raise ValueError
    except ValueError:
        raise BadInput(_TEXTS["at"].format(found=at)) from None
    if isinstance(model, ephs.Scene):
        return model.at(ephs.simulate(model, time, save_at=[time]), time), None
    return model, ephs.simulate(model, time, save_at=[time]).state_at(0)


def _ports(entries: list[str]) -> dict[str, dict[str, float]]:
    out: dict[str, dict[str, float]] = {}
    for entry in entries:
        port, _, given = entry.partition("=")
        side, _, number = given.partition(":")
        try:
            if side not in ("effort", "flow"):
                raise ValueError
            out[port] = {side: float(number or 0.0)}
        except ValueError:
            raise BadInput(_TEXTS["input"].format(found=entry)) from None
    return out
