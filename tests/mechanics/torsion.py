"""A disc on a torsion spring, whose equation is linear and known in closed form."""

__all__ = ["torsion"]


def torsion(inertia: float, stiffness: float, rate: float, rest: float = 0.0, friction: float = 0.0) -> str:
    """The scene as TOML: kg m², N m/rad, rad/s at the angle 0, rad, N m s/rad."""
    return f"""format = 1
name = "torsion"

[world]
gravity = [0.0, 0.0, 0.0]

[bodies.disc]
mass = 2.0
inertia = [0.6, 0.7, {inertia}]
angular_velocity = [0.0, 0.0, {rate}]

[joints.axle]
type = "revolute"
bodies = ["ground", "disc"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
stiffness = {stiffness}
rest = {rest}
friction = {friction}
"""
