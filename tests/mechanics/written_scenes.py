"""Scene files of what `drawn_scenes` and `touching_scenes` do not draw: sheets on bodies and beams, rods, machines."""

from tests.mechanics.own_elements import OWN

__all__ = ["WRITTEN"]

WORLD = """
[world]
gravity = [1.0, 0.5, -9.81]
temperature = 300.0
"""
LAYERED = """
[bodies.hub]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [-0.1, 0.2, 0.3]
rotation = [0.8, 0.0, 0.6, 0.0]
[joints.held]
type = "revolute"
bodies = ["ground", "hub"]
at = [-0.1, 0.2, 0.3]
axis = [0.0, 1.0, 0.0]
rate = 0.5
[thermal.frame]
capacity = 2.0
temperature = 310.0
[shells.skin]
corners = [[0.0, 0.0, 0.0], [0.6, 0.0, 0.1], [0.6, 0.4, 0.1], [0.0, 0.4, 0.0]]
elements = [1, 1]
spread = true
edges = ["free", "free", "free", "hub"]
pinned = [false, false, false, PINNED]
along = [1.0, 0.2, 0.0]
damping = 5e-3
pressure = 20.0
heat = "frame"
layers = [
    { thickness = 5e-3, E1 = 3e5, E2 = 1e5, G12 = 4e4, nu12 = 0.3, angle = 0.3, rho = 900.0 },
    { thickness = 5e-3, E1 = 3e5, E2 = 1e5, G12 = 4e4, nu12 = 0.3, angle = -0.5, rho = 900.0 },
]
"""
MESHED = """
[shells.skin]
points = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.3, 0.05], [0.0, 0.3, 0.0], [0.6, 0.1, 0.0]]
elements = [[0, 1, 2, 3], [1, 4, 2]]
sides = [[0, 3]]
edges = ["ground"]
thickness = 1e-2
E = 1e5
nu = 0.3
rho = 900.0
damping = 5e-3
spread = true
"""
RIBBED = """
[shells.left]
corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.2, 0.0], [0.0, 0.2, 0.0]]
elements = [1, 1]
thickness = 1e-2
E = 1e5
rho = 1000.0
damping = 1e-3
edges = ["rib", "free", "free", "free"]
[beams.rib]
from = [0.0, 0.0, 0.0]
to = [0.5, 0.0, 0.0]
elements = 2
section = { rectangle = [0.01, 0.04], E = 1e6, nu = 0.3, rho = 1000.0 }
ends = ["ground"]
"""
ROD = """
[thermal.core]
capacity = 1.0
temperature = 320.0
[beams.rod]
points = [[0.0, 0.0, 0.0], [0.4, 0.1, 0.0], [0.8, 0.0, 0.2]]
elements = 2
up = [0.0, 0.0, 1.0]
rod = "kirchhoff"
section = { GJ = 0.8, EI = [1.0, 2.0], rhoA = 1.0, rhoI = [2e-2, 1e-2, 1e-2] }
ends = ["ground"]
damping = 1e-3
heat = "core"
strain = [0.1, 0.2, 0.1, 0.0, 0.0, 0.0]
[loads.tip]
body = "rod.2"
force = [0.0, 0.0, 6.0]
ramp = 0.05
"""
STRING = """
[beams.string]
from = [0.0, 0.0, 0.0]
to = [0.7, 0.0, -0.7]
elements = 3
rod = "string"
section = { rhoA = 0.3 }
ends = ["ground"]
"""
EXPANDING = """
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [0.6, 0.0, 0.0]
elements = 3
order = 4
section = { circle = 0.02, E = 1e5, nu = 0.3, rho = 800.0 }
ends = ["ground"]
damping = 2e-3
thermal = { capacity = 40.0, conduction = 5.0, temperature = 320.0, expansion = 1e-3, reference = 300.0 }
surface = { stiffness = 2e3, loss = 0.1, friction = 0.3 }
[surfaces.floor]
body = "ground"
shape = { plane = {} }
position = [0.0, 0.0, -0.021]
"""
WINCH = """
[bodies.arm]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0.0, 0.0]
[bodies.hand]
mass = 0.5
inertia = [0.05, 0.05, 0.05]
position = [1.4, 0.1, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
rate = 0.3
dry = { coulomb = 0.5, slip = 0.1 }
limits = [-2.0, 0.01]
limit_stiffness = 1e3
limit_loss = 0.3
[joints.elbow]
type = "revolute"
bodies = ["arm", "hand"]
at = [1.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
rate = 0.5
armature = 0.02
[tendons.cable]
bodies = ["ground", "arm", "arm", "hand"]
points = [[0.0, 0.0, 0.4], [0.2, 0.1, 0.1], [0.4, 0.0, 0.1], [0.4, 0.2, 0.05]]
stiffness = 100.0
damping = 2.0
length = 1.5
[actuators.winch]
tendon = "cable"
ratio = -2.0
limits = [0.0, 3.0]
[actuators.push]
joints = ["elbow"]
ratio = 20.0
limits = [-1.0, 1.5]
"""
HOIST = """
[bodies.drum]
mass = 2.0
inertia = [0.01, 0.01, 0.02]
[bodies.load]
mass = 5.0
inertia = [0.01, 0.01, 0.01]
position = [0.1, 0.0, -1.0]
[joints.shaft]
type = "revolute"
bodies = ["ground", "drum"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "load"]
at = [0.1, 0.0, -1.0]
axis = [0.0, 0.0, 1.0]
[gears.rope]
joints = ["shaft", "rail"]
ratio = 10.0
friction = 0.05
heat = "bearing"
[thermal.bearing]
capacity = 10.0
temperature = 300.0
"""
WRITTEN = {
    name: WORLD + text
    for name, text in {
        "winch": WINCH,
        "own elements": OWN,
        "hoist": HOIST,
        "rod": ROD,
        "string": STRING,
        "mesh": MESHED,
        "rib": RIBBED,
        "warm rod": EXPANDING,
        "welded layers": LAYERED.replace("PINNED", "false"),
        "pinned layers": LAYERED.replace("PINNED", "true"),
    }.items()
}
"""Texts without their format."""
