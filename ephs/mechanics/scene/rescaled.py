"""A scene in other units of length, mass and time: the same mechanism, all its numbers changed."""

from dataclasses import replace

import numpy as np

from ephs.mechanics.scene.attached import ATTACHED, Attachment
from ephs.mechanics.scene.flexible import Load, Strain, Tendon
from ephs.mechanics.scene.geometry import Coupling, coupling_of
from ephs.mechanics.scene.model import Array, Body, Joint, Scene, Spring, frozen
from ephs.mechanics.scene.surfaces import Surface

__all__ = ["element_units", "freedom_units", "rescaled"]


def rescaled(scene: Scene, length: float = 1.0, mass: float = 1.0, time: float = 1.0) -> Scene:
    """The scene with every length multiplied by ``length``, every mass and time likewise; temperatures stay.

    By powers of two nothing is rounded. Shapes for pictures stay as they are.
    """
    energy = mass * length**2 / time**2
    place = np.array([1.0] * 4 + [length] * 3)
    twist = np.array([1.0] * 3 + [length] * 3) / time

    def body(b: Body) -> Body:
        return replace(
            b, mass=b.mass * mass, inertia=frozen(b.inertia * mass * length**2),
            pose=frozen(b.pose * place), twist=frozen(b.twist * twist),
        )  # fmt: skip

    def joint(j: Joint) -> Joint:
        of = coupling_of(j)
        unit = freedom_units(of, j.coordinate, length)
        force = energy / unit
        return replace(
            j,
            frame1=frozen(j.frame1 * place),
            frame2=frozen(j.frame2 * place),
            middle=None if j.middle is None else frozen(j.middle * place),
            pitch=j.pitch * length,
            friction=frozen(j.friction * np.outer(force, time / unit)),
            stiffness=frozen(j.stiffness * force / unit),
            rest=frozen(j.rest * unit),
            drive=frozen(j.drive * force),
            motion=None if j.motion is None else j.motion.rescaled(float(unit[0]), time),
            coordinate=frozen(j.coordinate * element_units(j.coordinate.size, unit, length)),
            rate=frozen(j.rate * unit / time),
            limits=None if j.limits is None else frozen(j.limits * unit[0]),
            stop=None if j.stop is None else j.stop.rescaled(float(unit[0]), energy * time**2 / unit[0] ** 2, time),
            dry=None if j.dry is None else j.dry.rescaled(float(force[0]), float(unit[0] / time)),
            strain=None if j.strain is None else strain(j.strain),
            armature=j.armature * energy * time**2 / (unit[0] ** 2 if j.armature else 1.0),
        )

    def strain(s: Strain) -> Strain:
        turning = np.array([1.0] * 3 + [1.0 / length] * 3)
        return Strain(
            s.length * length,
            frozen(s.stiffness * energy * length * turning**2),
            frozen(s.rest / length / turning),
            s.damping * time,
            s.order,
        )

    def attached(x: Attachment) -> Attachment:
        of = map(scene.joint, x.tied)
        units = [float(freedom_units(coupling_of(j), j.coordinate, length)[0]) for j in of]
        return x.rescaled(length, mass, time, units or [length])

    def tendon(t: Tendon) -> Tendon:
        return replace(
            t, points=frozen(t.points * length), stiffness=t.stiffness * mass / time**2, length=t.length * length,
            damping=t.damping * mass / time,
        )  # fmt: skip

    def load(x: Load) -> Load:
        force = energy / length
        return replace(x, force=frozen(x.force * force), moment=frozen(x.moment * energy), ramp=x.ramp * time)

    def spring(s: Spring) -> Spring:
        return replace(
            s, at1=frozen(s.at1 * length), at2=frozen(s.at2 * length), stiffness=s.stiffness * mass / time**2,
            length=s.length * length, damping=s.damping * mass / time,
        )  # fmt: skip

    def surface(s: Surface) -> Surface:
        sizes = {kind: size and (np.asarray(size) * length).tolist() for kind, size in s.shape.items()}
        return replace(s, shape=sizes, frame=frozen(s.frame * place))

    world = scene.world
    return replace(
        scene,
        world=replace(
            world, gravity=frozen(world.gravity * length / time**2), pressure=world.pressure * energy / length**3
        ),
        bodies={name: body(b) for name, b in scene.bodies.items()},
        joints={name: joint(j) for name, j in scene.joints.items()},
        springs={name: spring(s) for name, s in scene.springs.items()},
        thermal={
            name: replace(n, capacity=n.capacity * energy, pull=n.pull * energy / length)
            for name, n in scene.thermal.items()
        },
        conduction={
            name: replace(c, conductance=c.conductance * energy / time) for name, c in scene.conduction.items()
        },
        **{kind: {name: attached(x) for name, x in getattr(scene, kind).items()} for kind in ATTACHED},
        loads={name: load(x) for name, x in scene.loads.items()},
        tendons={name: tendon(t) for name, t in scene.tendons.items()},
        markers={name: replace(m, at=frozen(m.at * length)) for name, m in scene.markers.items()},
        surfaces={name: surface(s) for name, s in scene.surfaces.items()},
        contacts={name: replace(c, law=c.law.rescaled(length, mass, time)) for name, c in scene.contacts.items()},
        parts={name: rescaled(part, length, mass, time) for name, part in scene.parts.items()},
    )


def freedom_units(of: Coupling, x: Array, length: float) -> Array:
    """(d,) the unit of each coordinate of a joint at its element x: 1 for angles, of screws too, else the length."""
    return np.where(np.any(of.basis(x)[:3], axis=0), 1.0, length)


def element_units(size: int, unit: Array, length: float) -> Array:
    """(size,) units of a joint's element: of its coordinates, or of a quaternion and a position."""
    return unit if size == unit.size else np.array([1.0] * 4 + [length] * 3)[:size]
