"""Energy balance, position residual and entropy production of the natural method over 10⁴ steps, with friction."""

import ephs
from benchmarks.cases import CASES

STEPS = 10_000


def table() -> str:
    """The measurement as a table."""
    lines = [
        "| scene | friction | steps | h [s] | energy error | position residual | least entropy made [J/K] | µs/step |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for case in CASES:
        for scene, friction in ((case.scene(), "0"), (case.with_friction(), f"{case.friction:g}")):
            h = case.step
            out = ephs.simulate(scene, STEPS * h, step=h).summary()
            lines.append(
                f"| {case.name} | {friction} | {out['steps']} | {h:g} | {out['max_energy_error']:.1e} | "
                f"{out['max_constraint_error']:.1e} | {out['min_entropy_production']:.1e} | "
                f"{1e6 * out['integrate_s'] / out['steps']:.0f} |"
            )
    return "\n".join(lines)
