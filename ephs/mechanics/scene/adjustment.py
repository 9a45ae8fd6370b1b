"""Record of adjusting a scene: displaced bodies and replaced values."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Displacement:
    """Displacement of a body by the assembly: m, rad, and the change of its velocity in m/s and rad/s."""

    body: str
    distance: float
    angle: float
    speed: float
    spin: float


@final
@dataclass(frozen=True, slots=True)
class Changed:
    """A given coordinate or rate that contradicts others; ``taken`` is the value used instead."""

    joint: str
    what: str
    given: tuple[float, ...]
    taken: tuple[float, ...]


@final
@dataclass(frozen=True, slots=True)
class Adjustment:
    """Record of an adjusting assembly: the gaps that it found, the bodies that it moved, values not kept.

    ``gap`` is the largest gap of a joint before (m or rad), ``slip`` the largest velocity residual (m/s or
    rad/s).
    """

    gap: float
    slip: float
    moved: tuple[Displacement, ...]
    changed: tuple[Changed, ...] = ()

    def __str__(self) -> str:
        lines = [f"adjusted: largest gap {self.gap:.3g}, largest velocity residual {self.slip:.3g}"]
        for d in self.moved:
            lines.append(
                f"  {d.body}: moved {d.distance:.3g} m, {d.angle:.3g} rad; "
                f"velocity changed {d.speed:.3g} m/s, {d.spin:.3g} rad/s"
            )
        for c in self.changed:
            given, taken = (", ".join(f"{value:.6g}" for value in values) for values in (c.given, c.taken))
            lines.append(f"  {c.joint}: given {c.what} {given} contradicts others; {taken} is taken")
        return "\n".join(lines)
