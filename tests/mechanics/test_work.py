"""What steps cost, counted: a matrix that is a little wrong, or a guess that is lost, shows here and nowhere else."""

import json
from pathlib import Path

import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from examples.failing import oscillator
from tests.scenes import shipped

KNOWN = Path(__file__).with_name("work.json")
SCENES = ("slider-crank", "heavy-top", "hot-brake", "four-bar", "oscillator")
COUNTED = ("steps", "rejected", "iterations", "evaluations", "jacobians", "factorisations", "orders", "cut_steps")
SETTINGS = {
    name: [*([{"step": 0.01}] if m.fixed else []), *([{"rtol": 1e-4, "atol": 1e-6}] if m.adaptive else [])]
    for name, m in METHODS.items()
}
CASES = [
    (scene, name, setting)
    for scene in SCENES
    for name, found in SETTINGS.items()
    for setting in found
    if (METHODS[name].systems if scene == "oscillator" else METHODS[name].scenes)
]


def name_of(case) -> str:
    scene, name, setting = case
    return f"{scene}, {name}, {'constant' if 'step' in setting else 'chosen'} steps"


def counts(case) -> dict[str, int]:
    scene, name, setting = case
    # the work counts, not what comes of it: some of these steps are too long for the scene
    if scene == "oscillator":
        stats = ephs.simulate(
            oscillator(lambda q: 0.5 * q**2 + q**4), 4.0, initial={"pe.q": 1.0}, method=name, audit="off", **setting
        ).stats
    else:
        stats = ephs.simulate(shipped(scene), 0.4, method=name, audit="off", **setting).stats
    return {key: stats[key] for key in COUNTED if key in stats}


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_steps_take_the_work_that_they_took(case):
    """To a tenth, since rounding decides when an iteration has come to its end; less work is a reason to write it down.

    ``python -m tests.mechanics.test_work`` does.
    """
    known, found = json.loads(KNOWN.read_text(encoding="utf-8"))[name_of(case)], counts(case)
    assert found.keys() == known.keys()
    for key, value in found.items():
        few = 2 if known[key] > 4 else int(known[key] > 0 and key in ("rejected", "jacobians"))
        assert abs(value - known[key]) <= max(0.1 * known[key], few), key


if __name__ == "__main__":
    made = {name_of(case): counts(case) for case in CASES}
    lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(entry)}" for name, entry in made.items())
    KNOWN.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
