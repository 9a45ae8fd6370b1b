"""Cylinders on the rate of a joint: of oil between two supplies, and of gas against the environment."""

from collections.abc import Mapping, Sequence
from typing import Any

from ephs.mechanics.elements.gear import turns
from ephs.operad import Junction, Path, Pattern, Quantity, junction, quantity
from ephs.semantics import library
from ephs.semantics.primitives.constructors import gyrator
from ephs.semantics.primitives.forms import stored
from ephs.semantics.primitives.primitives import Storage, power_ports
from ephs.semantics.systems.system import Filling, System


def _compressed(v_a: Any, v_b: Any, q: Any, area_a: Any, area_b: Any, volume_a: Any, volume_b: Any, bulk: Any) -> Any:
    """Energy of the oil in both chambers, from its compression."""
    more = v_a - volume_a - area_a * q, v_b - volume_b + area_b * q
    return bulk * more[0] ** 2 / (2 * volume_a) + bulk * more[1] ** 2 / (2 * volume_b)


def hydraulic_cylinder(
    of: Quantity,
    *,
    area: Sequence[float],
    volume: Sequence[float],
    bulk: float,
    conductance: float,
    leak: float = 0.0,
    pressure: Sequence[float] = (0.0, 0.0),
    travel: float = 0.0,
    heat: bool = False,
) -> System:
    """A cylinder with two chambers of oil, or a hydraulic motor; ports a, b of the supplies, and p_r of the joint.

    Efforts at a and b are pressures above the environment's, flows are volumes a second into the chambers, through a
    line each that loses pressure. The box ``oil`` stores the oil in the chambers, ``v_a`` and ``v_b`` in m³, and how
    far the piston has moved, ``q``: E = Σ K (v − V ∓ A q)²/(2 V). Chamber a pushes towards larger coordinates.

    Parameters
    ----------
    of
        Momentum of a joint with one degree of freedom.
    area
        (2,) volume of each chamber by the coordinate, m³/m or m³/rad.
    volume
        (2,) of each chamber where q = 0, m³.
    bulk
        Its bulk modulus in Pa.
    conductance
        Of each line, m³/(s Pa).
    leak
        Across the piston, likewise.
    pressure
        (2,) of the oil in each chamber at the start, above the environment's, Pa.
    travel
        Displacement q of the piston at the start, rad or m.
    heat
        What lines and the leak lose leaves through the port s, in place of the box env.
    """
    place = quantity.angle if turns(of) else quantity.displacement
    junctions = {
        "p_r": junction(of, exposed=True),
        "q": junction(place),
        "s": junction(quantity.entropy, exposed=heat),
        **{name: junction(quantity.liquid, exposed=True) for name in ("a", "b")},
        **{name: junction(quantity.liquid) for name in ("v_a", "v_b")},
    }
    boxes = {
        "piston": {"q": "q", "p_r": "p_r"},
        "oil": {"v_a": "v_a", "v_b": "v_b", "q": "q"},
        "line_a": {"v1": "a", "v2": "v_a", "s": "s"},
        "line_b": {"v1": "b", "v2": "v_b", "s": "s"},
    }
    numbers = {
        f"{key}_{name}": float(x)
        for key, pair in {"area": area, "volume": volume}.items()
        for name, x in zip("ab", pair, strict=True)
    }
    held = {
        f"v_{name}": v * (1.0 + p / bulk) + a * x
        for name, v, p, a, x in zip("ab", volume, pressure, area, (travel, -travel), strict=True)
    }
    fillings: dict[str, Filling] = {
        "piston": gyrator({"q": place, "p_r": of}, [[0.0, -1.0], [1.0, 0.0]], name="pkc"),
        "oil": oil(place, {**numbers, "bulk": bulk}).with_initial({**held, "q": travel}),
        "line_a": library.laminar_leak(c=conductance),
        "line_b": library.laminar_leak(c=conductance),
    }
    if leak:
        boxes["leak"], fillings["leak"] = {"v1": "v_a", "v2": "v_b", "s": "s"}, library.laminar_leak(c=leak)
    return _closed(junctions, boxes, fillings, heat=heat)


def oil(place: Quantity, numbers: Mapping[str, float]) -> Storage:
    """Energy of the oil in both chambers; numbers are areas, volumes, and the bulk modulus."""
    return stored("oil", power_ports(v_a=quantity.liquid, v_b=quantity.liquid, q=place), _compressed, numbers)


def gas_spring(
    of: Quantity,
    *,
    area: float,
    volume: float,
    pressure: float,
    temperature: float,
    gamma: float = 1.4,
    conductance: float = 0.0,
    heat: bool = False,
) -> System:
    """An ideal gas behind a piston, the environment's pressure before it; port p_r of the joint.

    States are ``gas.s``, 0 at the pressure, temperature and volume that are given, ``gas.v``, and ``atmosphere.v``.

    Parameters
    ----------
    of
        Momentum of a joint with one degree of freedom.
    area
        Volume of the gas by the coordinate, m³/m or m³/rad; negative where it shrinks towards larger coordinates.
    volume, pressure, temperature
        The gas at the start, in m³, Pa (absolute) and K.
    gamma
        Its ratio of specific heats.
    conductance
        From the gas to the surroundings, W/K; 0: adiabatic.
    heat
        The surroundings are the port s, in place of the box env.
    """
    junctions = {
        "p_r": junction(of, exposed=True),
        "v": junction(quantity.volume),
        "w": junction(quantity.volume),
        "hot": junction(quantity.entropy),
    }
    boxes = {
        "piston": {"p_r": "p_r", "v": "v", "w": "w"},
        "gas": {"v": "v", "s": "hot"},
        "atmosphere": {"v": "w"},
    }
    skew = [[0.0, area, -area], [-area, 0.0, 0.0], [area, 0.0, 0.0]]
    heats = 1.0 / (gamma - 1.0)
    energy = heats * pressure * volume
    fillings: dict[str, Filling] = {
        "piston": gyrator({"p_r": of, "v": quantity.volume, "w": quantity.volume}, skew, name="gas_piston"),
        "gas": library.ideal_gas(c1=energy, c2=energy / temperature, v0=volume, c=heats).with_initial({"v": volume}),
        "atmosphere": library.environment(v=quantity.volume),
    }
    if conductance:
        junctions["s"] = junction(quantity.entropy, exposed=heat)
        boxes["wall"], fillings["wall"] = {"s1": "hot", "s2": "s"}, library.heat_transfer(h=conductance)
    return _closed(junctions, boxes, fillings, heat=heat or not conductance)


def _closed(
    junctions: dict[str, Junction], boxes: dict[str, dict[str, str]], fillings: dict[str, Filling], *, heat: bool
) -> System:
    """The system, with an environment for its heat unless a port carries it."""
    if not heat:
        boxes["env"], fillings["env"] = {"s": "s"}, library.environment()
    return System.of(
        Pattern(junctions=junctions, boxes=boxes), {Path.of(name): filling for name, filling in fillings.items()}
    )
