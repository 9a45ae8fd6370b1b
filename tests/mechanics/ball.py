"""A ball that falls onto a floor, bounces, slips and rolls: the text of a scene, without its slip velocity."""

BALL = """
format = 1
name = "ball"
[bodies.ball]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, 0.3]
velocity = [1.0, 0.0, 0.0]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
stiffness = 1e5
loss = 0.2
friction = 0.5
slip = {slip}
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
"""
