"""Machines put together by hand, and the same by equations that share nothing with the library."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.scene.build import initial_state, scene_system

SCENES = Path(__file__).parents[3] / "scenes"
THETA = 293.15

# ---- a motor on the four-bar linkage -----------------------------------------------------------------------------

VOLTAGE, RESISTANCE, INDUCTANCE, FLUX, GEAR, ROTOR = 12.0, 0.8, 2e-3, 0.08, 0.15, 2e-4
HEAT, COOLING = 40.0, 0.3
A, B, C, D = 0.3, 0.9, 0.7, 1.0


def four_bar():
    """The linkage of the scene, its crank's momentum an outer port."""
    scene = ephs.load(SCENES / "four-bar.toml")
    joints = {name: replace(j, drive=None) if name == "main" else j for name, j in scene.joints.items()}
    scene = replace(scene, joints=joints)
    return scene_system(scene, driven=["main"]), {f"linkage.{path}": x for path, x in initial_state(scene).items()}


@cache
def motor_on_four_bar():
    """(system, initial values, inputs): a circuit with a magnet, a rotor, a gear, a housing that is cooled."""
    linkage, start = four_bar()
    port = "drives.main"
    junctions = {
        "q": junction(Q.charge, exposed=True),
        "b": junction(Q.flux_linkage),
        "magnet": junction(Q.flux_linkage),
        "p": junction(Q.angular_momentum),
        "p_r": junction(linkage.interface[port].quantity),
        "s": junction(Q.entropy),
        "around": junction(Q.entropy),
    }
    boxes = {
        "supply": {"q": "q", "b": "b"},
        "coil": {"b": "b"},
        "copper": {"b": "b", "s": "s"},
        "field": {"b": "magnet"},
        "coupling": {"b": "b", "p": "p", "bs": "~magnet"},
        "rotor": {"p": "p"},
        "gear": {"p": "p", "p_r": "p_r"},
        "linkage": {port: "p_r"},
        "housing": {"s": "s"},
        "fan": {"s1": "s", "s2": "around"},
        "air": {"s": "around"},
    }
    system = Pattern(junctions=junctions, boxes=boxes)(
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
