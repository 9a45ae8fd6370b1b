"""Float runs and machine code give the same bits: of every entry function that runs call, by each method and element.

The registry is what runs, their derivatives and functions of a state call themselves, from Python and by addresses;
programs and entry functions that must be among it are named.
"""

import numpy as np
import pytest

import ephs
from ephs import Pattern, library
from ephs.semantics.stage.elementary import COMPOSED
from tests.scenes import ROOT
from tests.watch import watching
from tests.written import scene_of_text

pytestmark = pytest.mark.optimised

HEAD = 'format = 1\nname = "few"\n[world]\ngravity = [0.0, 0.0, -9.81]\n'
BALL = """
[bodies.ball]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.0, 0.0999]
velocity = [0.1, 0.0, -0.1]
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
SOFT = BALL.replace("sphere = 0.1 }", "sphere = 0.1 }\nstiffness = 1e5\nloss = 0.3\nfriction = 0.4\nslip = 1e-3")
HARD = BALL.replace("sphere = 0.1 }", "sphere = 0.1 }\nrestitution = 0.5\nfriction = 0.4")
HARD = HARD.replace("plane = {} }", "plane = {} }\nrestitution = 0.5\nfriction = 0.4").replace("0.0999", "0.1001")
BEAM = """
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = 1
order = 4
section = { circle = 0.01, E = 2e9, nu = 0.3, rho = 7850.0 }
[joints.clamp]
type = "fixed"
bodies = ["ground", "rod.0"]
at = [0.0, 0.0, 0.0]
"""


def circuit():
    """A capacitor with a coil, whose energy is kept."""
    pattern = Pattern.from_text("q: charge; b: flux_linkage; cap(q); coil(b); emc(q, b)")
    parts = {"cap": library.capacitor(c=0.5).with_initial({"q": 1.0}), "coil": library.inductor(l=2.0)}
    return pattern(**parts, emc=library.emc())


def led():
    """A loop with a crank whose motion is prescribed."""
    text = (ROOT / "scenes/slider-crank.toml").read_text(encoding="utf-8")
    return scene_of_text(text.replace("drive = 0.06", "motion = { rate = 10.0 }"))


def derivatives(method):
    """Of a run, by the mass of its last body."""

    def run(scene):
        path = f"bodies.{list(scene.bodies)[-1]}.mass"
        ephs.sensitivity(scene, [path], 0.002, method=method, step=0.001)

    return run


def instant(scene):
    """What there is to say of a state, with derivatives."""
    model = ephs.dynamics(scene)
    model.acceleration(model.state0)
    model.gravity(model.state0)
    model.derivatives(model.state0)
    ephs.linearize(scene)


CASES = {
    "loops": ("scenes/slider-crank.toml", {"method": "rk87", "until": 0.002}, {"motion_of_loops", "element", "states"}),
    "network": ("scenes/motor-four-bar.toml", {"method": "rk54", "until": 0.002}, {"network", "resting"}),
    "natural": ("scenes/four-bar.toml", {"method": "natural", "until": 0.01, "step": 0.01}, {"evaluation", "natural"}),
    "natural4": (
        "scenes/body.toml",
        {"method": "natural4", "until": 0.01, "step": 0.01},
        {"natural_of_3_stages", "evaluation"},
    ),
    "radau": ("scenes/chain.toml", {"method": "radau", "until": 0.002}, {"stiff_steps_of_trees"}),
    "contact": (SOFT, {"method": "rk87", "until": 1e-4}, {"motion_of_trees", "resting"}),
    "stiff contact": (SOFT, {"method": "radau", "until": 1e-4}, {"stiff_steps_of_trees"}),
    "coarse contact": (SOFT, {"method": "auto", "until": 1e-4, "rtol": 1e-2}, {"lagged_steps_of_trees", "onsager"}),
    "hard contact": (HARD, {"method": "rk87", "until": 2e-3}, {"motion_of_trees"}),
    "beam": (BEAM, {"method": "natural", "until": 1e-4, "step": 1e-4}, {"natural", "element"}),
    "circuit": (circuit, {"method": "radau", "until": 0.2, "step": 0.1}, {"integral", "settling"}),
    "variational": ("scenes/slider-crank.toml", {"method": "variational", "until": 0.01, "step": 0.01}, {"action"}),
    "led loop": (led, {"method": "rk87", "until": 0.002}, {"power"}),
    "derivatives of loops": (
        "scenes/slider-crank.toml",
        derivatives("rk54"),
        {"steps_of_loops_along_4", "bare_along_4", "across", "gaps", "unfold", "relative_rates"},
    ),
    "derivatives of trees": ("scenes/heavy-top.toml", derivatives("rk54"), {"steps_of_trees_along_4"}),
    "derivatives of natural": ("scenes/heavy-top.toml", derivatives("natural"), {"natural_along", "linear_along_4"}),
    "instant": ("scenes/slider-crank.toml", instant, {"point", "rigid", "tangents", "twists"}),
}


def watched(case, tmp_path):
    of, run, _ = CASES[case]
    if isinstance(of, str):
        file = tmp_path / "few.toml"
        file.write_text(HEAD + of)
        model = ephs.load(of if of.endswith(".toml") else file)
    else:
        model = of()
    with watching() as watch:
        if callable(run):
            run(model)
        else:
            ephs.simulate(model, **run, audit="off")
    return watch


@pytest.mark.parametrize("case", CASES)
def test_every_call_of_a_run_has_the_bits_of_the_float_run(case, tmp_path):
    watch = watched(case, tmp_path)
    assert not watch.differing
    assert CASES[case][2] <= {name for key in watch.seen for name in key}


def test_another_last_bit_is_noticed(tmp_path, monkeypatch):
    watched("natural", tmp_path)  # programs are in machine code, or written once, before functions change
    exact = COMPOSED["sin"]
    monkeypatch.setitem(COMPOSED, "sin", lambda on, x: np.nextafter(exact(on, x), 2.0))
    assert watched("natural", tmp_path).differing
