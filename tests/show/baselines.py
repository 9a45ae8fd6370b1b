"""The paper's patterns, placed by hand, and the pictures of them that are kept.

``python -m tests.show.baselines`` draws them anew, to be looked at before they are committed.
"""

from pathlib import Path

from ephs.show import Drawing, draw
from tests.operad.models import DAMPED, OSCILLATOR
from tests.show.pictures_of_patterns import KINDS, body, flat, joint, kinds_of, mbs

FOLDER = Path(__file__).with_name("baselines")

BODY_AT = {"pe": (0, 0), "q": (1, 0), "pkc": (2, 0), "p": (3, 0), "ke": (3, 1), "lp": (3, -1)}
JOINT_AT = {
    "p_1": (0, 0), "o_1": (1, 0), "p_j1": (2, 0), "hc": (3, 0), "p_j2": (4, 0), "o_2": (5, 0), "p_2": (6, 0),
    "q_r": (2.4, -1), "pe": (1.3, -1.5), "pkc": (3, -2), "p_r": (3.6, -1), "mf": (4.6, -1.5), "s": (5.5, -1.5),
    "env": (6.4, -1.5),
}  # fmt: skip
MBS_AT = {"b1": (0, 0), "p_1": (1, 0), "j": (2, 0), "p_2": (3, 0), "b2": (4, 0)}


def _flat_at() -> dict[str, tuple[float, float]]:
    """The two bodies at either side of the joint."""
    at = {f"j.{name}": (x + 0.5, y) for name, (x, y) in JOINT_AT.items() if name not in ("p_1", "p_2")}
    at |= {"p_1": (0.0, 0.0), "p_2": (7.0, 0.0)}
    for box, end, sign in (("b1", 0.0, -1.0), ("b2", 7.0, 1.0)):
        at |= {
            f"{box}.ke": (end, 1.0),
            f"{box}.lp": (end + 0.9 * sign, 0.6),
            f"{box}.pkc": (end + sign, -0.5),
            f"{box}.q": (end + sign, -1.3),
            f"{box}.pe": (end + sign, -2.1),
        }
    return at


def drawings() -> dict[str, Drawing]:
    """Every picture that is kept, by name."""
    kinds = KINDS | {"osc": "composite"}
    damped = DAMPED.substitute(osc=OSCILLATOR)
    plain = {"pe": (0, 0), "q": (1, 0), "pkc": (2, 0), "p": (3, 0), "ke": (4, 0)}
    rest = {"mf": (4, -1), "s": (5, -1), "env": (6, -1)}
    placed = {
        "oscillator": (OSCILLATOR, plain),
        "damped-oscillator": (
            DAMPED,
            {"osc": (0, 0), "p": (1, 0), "mf": (2, 0), "s": (3, 0), "env": (4, 0)},
        ),
        "damped-oscillator-flat": (
            damped,
            {name if name == "p" else f"osc.{name}": point for name, point in plain.items()} | rest,
        ),
        "body": (body(), BODY_AT),
        "joint": (joint(), JOINT_AT),
        "mbs": (mbs(), MBS_AT),
        "mbs-flat": (flat(), _flat_at()),
    }
    return {
        name: draw(pattern, positions=at, kinds=kinds_of(pattern) | {b: kinds[b] for b in kinds if b in pattern.boxes})
        for name, (pattern, at) in placed.items()
    }


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, drawing in drawings().items():
        print(drawing.save(FOLDER / f"{name}.svg"), drawing.faults)
