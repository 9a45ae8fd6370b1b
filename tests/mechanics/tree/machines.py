"""Machines put together by hand, and the same by equations that share nothing with the library."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.scene.build import initial_state, scene_system
from tests.scenes import shipped

THETA = 293.15

# ---- a motor on the four-bar linkage -----------------------------------------------------------------------------

VOLTAGE, RESISTANCE, INDUCTANCE, FLUX, GEAR, ROTOR = 12.0, 0.8, 2e-3, 0.08, 0.15, 2e-4
HEAT, COOLING = 40.0, 0.3
A, B, C, D = 0.3, 0.9, 0.7, 1.0


def four_bar():
    """The linkage of the scene, its crank's momentum an outer port."""
    scene = shipped("four-bar")
    joints = {name: replace(j, drive=None) if name == "main" else j for name, j in scene.joints.items()}
    scene = replace(scene, joints=joints)
    return scene_system(scene, driven=["main"]), {f"linkage.{path}": x for path, x in initial_state(scene).items()}


@cache
def motor_on_four_bar():
    """(system, initial values, inputs): a circuit with a magnet, a rotor, a gear, a housing that is cooled."""
    linkage, start = four_bar()
    port = "drives.main"
    pattern = Pattern.from_text(
        "q: charge, exposed; b: flux_linkage; magnet: flux_linkage; p: angular_momentum; "
        "p_r: joint_momentum(revolute); s: entropy; around: entropy; supply(q, b); coil(b); copper(b, s); "
        "field(b=magnet); coupling(b, p, bs=~magnet); rotor(p); gear(p, p_r); linkage(drives.main=p_r); housing(s); "
        "fan(s1=s, s2=around); air(s=around)"
    )
    system = pattern(
        supply=lib.emc(),
        coil=lib.inductor(l=INDUCTANCE),
        copper=lib.resistor(r=RESISTANCE),
        field=lib.inductor(l=1.0),
        coupling=lib.mkc(),
        rotor=lib.rotor(j=ROTOR),
        gear=ephs.transformer(
            {"p": Q.angular_momentum, "p_r": linkage.interface[port].quantity}, [[GEAR]], name="gear"
        ),
        linkage=linkage,
        housing=lib.thermal_capacity(c1=THETA * HEAT, c2=HEAT),
        fan=lib.heat_transfer(h=COOLING),
        air=lib.environment(),
    )
    return system, start | {"field.b": FLUX}, {"q": {"effort": VOLTAGE}}


@cache
def motor_by_hand(until):
    """(angle and rate of the crank, current, temperature of the housing) at the end."""
    end = solve_ivp(_motor, (0.0, until), [np.pi / 2, 0.0, 0.0, THETA], method="DOP853", rtol=1e-13, atol=1e-14)
    return end.y[:, -1]


def _motor(_, y):
    angle, rate, current, warmth = y
    mass, slope, pull, lean = _four_bar(angle)
    torque = FLUX * current / GEAR - 0.05 * rate - 0.2 * lean**2 * rate - pull - 0.5 * slope * rate**2
    voltage = VOLTAGE - RESISTANCE * current - FLUX * rate / GEAR
    heat = RESISTANCE * current**2 - COOLING * (warmth - THETA)
    return [rate, torque / (mass + ROTOR / GEAR**2), voltage / INDUCTANCE, heat / HEAT]


def _four_bar(angle):
    """Inertia on the crank, its derivative, the gravity torque, and the rocker's rate by the crank's."""

    def along(x):
        return np.array([np.cos(x), np.sin(x)])

    def across(x):
        return np.array([-np.sin(x), np.cos(x)])

    reach = np.array([D, 0.0]) - A * along(angle)  # from the crank's pin to the rocker's pivot
    far = float(np.hypot(*reach))
    coupler = np.arctan2(reach[1], reach[0]) + np.arccos((far**2 + B**2 - C**2) / (2.0 * far * B))
    tip = A * along(angle) + B * along(coupler) - [D, 0.0]
    rocker = float(np.arctan2(tip[1], tip[0]))
    # A n₁ + B n₂ k₂ = C n₃ k₃, and its derivative by the angle
    matrix = np.column_stack([B * across(coupler), -C * across(rocker)])
    k2, k3 = np.linalg.solve(matrix, -A * across(angle))
    right = A * along(angle) + B * along(coupler) * k2**2 - C * along(rocker) * k3**2
    d2, d3 = np.linalg.solve(matrix, right)
    centre = A * across(angle) + 0.5 * B * across(coupler) * k2
    turned = -A * along(angle) - 0.5 * B * along(coupler) * k2**2 + 0.5 * B * across(coupler) * d2
    crank, bar, swing = 0.0045 + 0.6 * (A / 2) ** 2, 0.1215, 0.05716666666666665 + 1.4 * (C / 2) ** 2
    mass = crank + 1.8 * centre @ centre + bar * k2**2 + swing * k3**2
    slope = 2.0 * (1.8 * centre @ turned + bar * k2 * d2 + swing * k3 * d3)
    pull = 9.81 * (0.6 * 0.5 * A * np.cos(angle) + 1.8 * centre[1] + 1.4 * 0.5 * C * np.cos(rocker) * k3)
    return mass, slope, pull, k3


# ---- a gas spring and a damper with hot oil on a slider-crank -----------------------------------------------------

AREA, GAS, EXPONENT, HOT, DAMPING, OIL, WALL, FINS = 2e-3, 2.0e-4, 2.5, 600.0, 60.0, 5.0, 0.3, 0.8
PRESSURE = 101325.0
CRANK, ROD, SPEED = 0.04, 0.14, 10.0
SHAFT = 0.06


def slider_crank():
    """The mechanism of the scene without friction, the momentum of its cylinder joint an outer port."""
    scene = shipped("slider-crank")
    joints = {name: replace(j, friction=0.0 * j.friction, heat="environment") for name, j in scene.joints.items()}
    scene = replace(scene, joints=joints, thermal={}, conduction={})
    return scene_system(scene, driven=["cylinder"]), {f"engine.{path}": x for path, x in initial_state(scene).items()}


@cache
def gas_spring_on_slider_crank():
    """(system, initial values, inputs): hot gas before the piston, the atmosphere behind, oil that a damper warms."""
    engine, start = slider_crank()
    port = "drives.cylinder"
    energy = EXPONENT * PRESSURE * GAS
    capacity = energy / THETA
    pattern = Pattern.from_text(
        "v: volume; w: volume; s: entropy; hot: entropy; around: entropy; p: momentum; "
        "p_r: joint_momentum(prismatic); shaft: joint_momentum(revolute), exposed; gas(v, s); atmosphere(v=w); "
        "piston(v1=v, v2=w, p); rod(p, p_r); damper(p, s=hot); oil(s=hot); wall(s1=s, s2=hot); "
        "fins(s1=hot, s2=around); air(s=around); engine(drives.cylinder=p_r, drives.bearing=shaft)"
    )
    system = pattern(
        gas=lib.ideal_gas(c1=energy, c2=capacity, v0=GAS, c=EXPONENT),
        atmosphere=lib.environment(v=Q.volume),
        piston=lib.piston(a=AREA),
        rod=ephs.transformer({"p": Q.momentum, "p_r": engine.interface[port].quantity}, [[1.0]], name="rod"),
        damper=lib.friction(d=DAMPING),
        oil=lib.thermal_capacity(c1=THETA * OIL, c2=OIL),
        wall=lib.heat_transfer(h=WALL),
        fins=lib.heat_transfer(h=FINS),
        air=lib.environment(),
        engine=engine,
    )
    start = start | {"atmosphere.v": 1.0, "gas.v": GAS, "gas.s": capacity * np.log(HOT / THETA)}
    return system, start, {"shaft": {"flow": SHAFT}}


@cache
def gas_spring_by_hand(until):
    """(angle and rate of the crank, volume and temperature of the gas, temperature of the oil) at the end."""
    first = [np.pi / 2, -SPEED, GAS, HOT, THETA]
    end = solve_ivp(_gas_spring, (0.0, until), first, method="DOP853", rtol=1e-13, atol=1e-15)
    return end.y[:, -1]


def _gas_spring(_, y):
    angle, rate, volume, gas, oil = y
    mass, slope, pull, along = _slider_crank(angle)
    capacity = EXPONENT * PRESSURE * GAS / THETA
    pressure = capacity * gas / (EXPONENT * volume)
    speed = along * rate
    force = (pressure - PRESSURE) * AREA - DAMPING * speed
    torque = force * along - SHAFT - pull - 0.5 * slope * rate**2
    growth, warmed = AREA * speed, WALL * (oil - gas)
    heat = DAMPING * speed**2 - warmed - FINS * (oil - THETA)
    return [rate, torque / mass, growth, (warmed - pressure * growth) / capacity, heat / OIL]


def _slider_crank(angle):
    """Inertia on the crank, its derivative, the gravity torque, and the slider's speed by the crank's rate."""
    s, c = np.sin(angle), np.cos(angle)
    lean = np.arcsin(CRANK * s / ROD)  # of the rod, below the line of the slider
    k = -CRANK * c / (ROD * np.cos(lean))  # rate of the rod's angle by the crank's
    dk = (CRANK * s + ROD * np.sin(-lean) * k**2) / (ROD * np.cos(lean))
    along = -CRANK * s - ROD * np.sin(-lean) * k
    turned = -CRANK * c - ROD * np.cos(lean) * k**2 - ROD * np.sin(-lean) * dk
    far = 0.5 * ROD
    centre = np.array([-CRANK * s - far * np.sin(-lean) * k, CRANK * c + far * np.cos(lean) * k])
    bent = np.array(
        [
            -CRANK * c - far * np.cos(lean) * k**2 - far * np.sin(-lean) * dk,
            -CRANK * s - far * np.sin(-lean) * k**2 + far * np.cos(lean) * dk,
        ]
    )
    mass = 9e-4 + 0.15 * centre @ centre + 2.5e-4 * k**2 + 0.25 * along**2
    slope = 2.0 * (0.15 * centre @ bent + 2.5e-4 * k * dk + 0.25 * along * turned)
    return mass, slope, 9.81 * 0.15 * centre[1], along


# ---- wheels on gears ---------------------------------------------------------------------------------------------

WHEEL, GRAVITY = 1.3, 9.81


def train(bodies, gears):
    """Wheels on hinges, each on the ground or on the wheel before; gears tie their rates.

    Parameters
    ----------
    bodies
        (whether it is on the one before, distance of its centre from its hinge).
    gears
        (of wheels, ratios): Σ ratio · rate = 0.
    """
    hinges = [
        joint("revolute", [1, 0, 0, 0, 0.2 * k, 0, 0], [1, 0, 0, 0, -away, 0, 0], driven=True)
        for k, (_, away) in enumerate(bodies)
    ]
    port = next(str(p) for p in hinges[0].interface if str(p) not in ("p1", "p2"))
    of = hinges[0].interface[port].quantity
    junctions = {"g": junction(Q.body_momentum)}
    boxes, fillings = {"ground": {"p": "g"}}, {"ground": components.ground()}
    for k, (carried, _) in enumerate(bodies):
        junctions |= {f"b{k}": junction(Q.body_momentum), f"p{k}": junction(of)}
        boxes |= {f"w{k}": {"p": f"b{k}"}, f"h{k}": {"p1": f"b{k - 1}" if carried and k else "g", "p2": f"b{k}"}}
        boxes[f"h{k}"][port] = f"p{k}"
        fillings |= {f"w{k}": rigid_body(WHEEL, [0.3, 0.4, 0.5], [0.0, -GRAVITY, 0.0]), f"h{k}": hinges[k]}
    for number, (wheels, ratios) in enumerate(gears):
        boxes[f"gear{number}"] = {f"x{i}": f"p{k}" for i, k in enumerate(wheels)}
        ports = {f"x{i}": of for i in range(len(wheels))}
        fillings[f"gear{number}"] = ephs.constraint(ports, [list(ratios)], name="gear")
    system = Pattern(junctions=junctions, boxes=boxes)(**fillings)
    poses, place = {}, np.zeros(3)
    for k, (carried, away) in enumerate(bodies):
        centre = place if carried and k else np.zeros(3)
        place = centre + np.array([0.2 * k + away, 0.0, 0.0])
        poses[f"w{k}.pe.q"] = np.array([1.0, 0.0, 0.0, 0.0, *place])
    return system, poses
