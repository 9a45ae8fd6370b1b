"""`ephs export`, `ephs fmu`: a mechanism as a program without Python, or as a unit of FMI."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from ephs.cli.input import AS_GIVEN, LoadOptions, addressed, load_model, say

exports = App(name="export", help="Write a mechanism as a program without Python: C, object code, WebAssembly.")
units = App(name="fmu", help="Write a mechanism as a unit of FMI 3.0 for co-simulation.")


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
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Write a mechanism as a program without Python; prints its inputs and outputs.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    out
        File to write: .c or .o, with a header .h beside it; .wasm.
    inputs
        Joints on which forces, and actuators whose controls, are given from outside, between commas:
        joints.waist,actuators.servo.
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

    return _written(
        lambda model, given: ephs.export(model, out, method=method, step=step, until=until, target=target, **given),
        scene, out, loading, (inputs, parameters, rtol, atol),
    )  # fmt: skip


@units.default
def fmu(
    scene: str,
    /,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])],
    inputs: str = "",
    parameters: str = "",
    outputs: str = "",
    method: str = "rk87",
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    until: float = 10.0,
    platforms: str = "",
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Write a mechanism as a unit of FMI 3.0 for co-simulation; prints its variables.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    out
        File to write, that ends in .fmu.
    inputs
        Joints on which forces, and actuators whose controls, are given from outside, between commas:
        joints.waist,actuators.servo.
    parameters
        Numbers that may be changed before the start, between commas: bodies.rod.mass,joints.bearing.friction.
    outputs
        Outputs, or beginnings of their names, between commas: joints,bodies.rod; all unless given.
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
    platforms
        Machines by their names in FMI, between commas: x86_64-linux,x86_64-windows; five unless given.
    """
    import ephs

    named = {"outputs": _listed(outputs), "platforms": _listed(platforms)}
    chosen: dict[str, Any] = {key: names for key, names in named.items() if names}
    return _written(
        lambda model, given: ephs.export_fmu(model, out, method=method, step=step, until=until, **chosen, **given),
        scene, out, loading, (inputs, parameters, rtol, atol),
    )  # fmt: skip


def _listed(names: str) -> list[str]:
    return [one.strip() for one in names.split(",") if one.strip()]


def _written(
    write: Callable[[Any, dict[str, Any]], Any], scene: str, out: Path, loading: LoadOptions,
    options: tuple[str, str, float | None, float | None],
) -> int:  # fmt: skip
    """Write a model, and print its variables."""
    model = load_model(scene, loading)
    inputs, parameters, rtol, atol = options
    given = {"inputs": _listed(inputs), "parameters": _listed(parameters)}
    tolerances = {key: x for key, x in (("rtol", rtol), ("atol", atol)) if x is not None}
    with addressed(scene, out):
        made = write(model, {**given, **tolerances})
    for kind, variables in (("input", made.inputs), ("parameter", made.parameters), ("output", made.outputs)):
        for place, variable in enumerate(variables):
            say(f"{kind:9} {place:4} {variable.name:40} {variable.start:>14.6g} {variable.unit}".rstrip())
    say(f"{out}: functions {made.name}_*, {made.bytes} bytes an instance")
    return 0
