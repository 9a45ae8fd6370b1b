"""`ephs export`: a mechanism as a program without Python."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from ephs.cli.input import AS_GIVEN, BadInput, Loading, addressed, load_model, naming, say

__all__ = ["exports"]

exports = App(name="export", help="Write a mechanism as a program without Python: C, object code, WebAssembly.")


@exports.default
def export(
    scene: str,
    /,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])],
    inputs: str = "",
    parameters: str = "",
    method: str = "rk87",
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    until: float = 10.0,
    target: str | None = None,
    loading: Loading = AS_GIVEN,
) -> int:
    """Write a mechanism as a program without Python; prints its inputs and outputs.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    out
        File to write: .c or .o, with a header .h beside it; .wasm.
    inputs
        Joints on which forces are given from outside, between commas: joints.waist,joints.elbow.
    parameters
        Numbers that may be changed at the start, between commas: bodies.rod.mass,joints.bearing.friction.
    method
        rk54 or rk87.
    rtol
        Relative tolerance of steps; 1e-6 unless given.
    atol
        Absolute tolerance of steps; 1e-9 unless given.
    step
        Length of constant steps, in s.
    until
        Time in s over which the error is to stay within the tolerances.
    target
        Machine of object code, as linux-arm64; left out, this one.
    """
    import ephs

    model = load_model(scene, loading)
    names, numbers = ([one.strip() for one in given.split(",") if one.strip()] for given in (inputs, parameters))
    tolerances: dict[str, Any] = {key: x for key, x in (("rtol", rtol), ("atol", atol)) if x is not None}
    try:
        with addressed(scene, out):
            made = ephs.export(
                model, out, inputs=names, parameters=numbers, method=method, step=step, until=until, target=target,
                **tolerances,
            )  # fmt: skip
    except ephs.ExportError as error:
        raise BadInput(naming(scene, str(error))) from error
    for kind, variables in (("input", made.inputs), ("parameter", made.parameters), ("output", made.outputs)):
        for place, variable in enumerate(variables):
            say(f"{kind:9} {place:4} {variable.name:40} {variable.start:>14.6g} {variable.unit}".rstrip())
    say(f"{out}: functions {made.name}_*, {made.bytes} bytes an instance")
    return 0
