"""`ephs equilibrium`: the shape of a scene at rest under its loads."""

import json
from pathlib import Path
from typing import Any

from cyclopts import App

from ephs.cli.input import AS_GIVEN, BadInput, LoadOptions, addressed, load_model, naming, say

_TEXTS = {"system": "{found}: expected a scene; ephs.equilibrium takes systems in Python"}

resting = App(name="equilibrium", help="Find the shape of a scene at rest under its loads.")


@resting.default
def equilibrium(scene: str, /, *, out: Path | None = None, loading: LoadOptions = AS_GIVEN) -> int:
    """Find the static equilibrium by continuation of the loads; prints positions of bodies and buckling loads.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    out
        Folder for equilibrium.json: bodies, joints, load path and its critical points.
    """
    import ephs

    model = load_model(scene, loading)
    if not isinstance(model, ephs.Scene):
        raise BadInput(_TEXTS["system"].format(found=scene))
    try:
        with addressed(scene):
            found = ephs.equilibrium(model)
    except ephs.SimulationError as error:
        raise BadInput(naming(scene, str(error))) from error
    rest: Any = found.model
    bodies = {name: body.pose for name, body in rest.all_bodies()}
    say(f"at rest after {found.steps} steps, {found.residual:.1e} of the forces unbalanced")
    for name, pose in bodies.items():
        say(f"{name:24}" + "".join(f"{x:>14.6g}" for x in pose[4:]))
    if found.critical:
        say("critical at these parts of the loads: " + ", ".join(f"{x:.6g}" for x in found.critical))
    if out is not None:
        from ephs.solve.result.durable import durable

        text = {
            "scene": rest.name, "steps": found.steps, "residual": found.residual,
            "shares": found.shares.tolist(), "critical": list(found.critical),
            "bodies": {n: {"position": p[4:].tolist(), "quaternion": p[:4].tolist()} for n, p in bodies.items()},
            "joints": {name: {"coordinate": joint.coordinate.tolist()} for name, joint in rest.all_joints()},
        }  # fmt: skip
        with addressed(scene, out):
            out.mkdir(parents=True, exist_ok=True)
            with durable(out / "equilibrium.json") as temporary:
                temporary.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")
        say(f"equilibrium: {out / 'equilibrium.json'}")
    return 0
