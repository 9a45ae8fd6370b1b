"""Motors with a permanent magnet: a circuit, a magnet, a rotor and a gear on the rate of a joint."""

import numpy as np

from ephs.operad import Path, Pattern, Quantity, junction, quantity
from ephs.semantics import library
from ephs.semantics.primitives.constructors import transformer
from ephs.semantics.primitives.primitives import Storage, power_ports
from ephs.semantics.primitives.structures import quadratic
from ephs.semantics.systems.system import System


def armature(of: Quantity, inertia: float) -> Storage:
    """Inertia of a joint's rate itself, as of a rotor that it turns; port p of the joint's momentum.

    Parameters
    ----------
    of
        Momentum of a joint with one degree of freedom.
    inertia
        In kg m², or kg of a joint that slides.
    """
    parameters = (("inertia", inertia),)
    return quadratic("armature", power_ports(p=of), np.array([[1.0 / inertia]]), parameters, trusted=True)


def motor(
    of: Quantity,
    *,
    constant: float,
    resistance: float,
    gear: float = 1.0,
    inductance: float = 0.0,
    inertia: float = 0.0,
    current: float = 0.0,
    heat: bool = False,
) -> System:
    """A direct-current motor; ports q, whose effort is the voltage and whose flow the current, and p_r of the joint.

    Its magnet is the state ``field.b``, the flux linkage of one henry, which begins and stays at the motor's constant.

    Parameters
    ----------
    of
        Momentum of a joint with one degree of freedom.
    constant
        N m/A, which is V s/rad: torque of the rotor by the current.
    resistance, inductance
        Of the winding in Ω and H.
    gear
        Rate of the rotor by the joint's, in rad/rad or rad/m.
    inertia
        Of the rotor in kg m².
    current
        At the start, where there is an inductance, in A.
    heat
        The winding's heat leaves through the port s, in place of the box env.
    """
    junctions = {
        "q": junction(quantity.charge, exposed=True),
        "b": junction(quantity.flux_linkage),
        "flux": junction(quantity.flux_linkage),
        "p": junction(quantity.angular_momentum),
        "p_r": junction(of, exposed=True),
        "s": junction(quantity.entropy, exposed=heat),
    }
    boxes = {
        "supply": {"q": "q", "b": "b"},
        "winding": {"b": "b", "s": "s"},
        "field": {"b": "flux"},
        "magnet": {"b": "b", "p": "p", "bs": "~flux"},
        "gear": {"p_r": "p_r", "p": "p"},
    }
    fillings = {
        "supply": library.emc(),
        "winding": library.resistor(r=resistance),
        "field": library.inductor(l=1.0).with_initial({"b": constant}),
        "magnet": library.mkc(),
        "gear": transformer({"p_r": of, "p": quantity.angular_momentum}, [[gear]], name="gear"),
    }
    for name, port, filling in (
        ("coil", "b", library.inductor(l=inductance).with_initial({"b": inductance * current}) if inductance else None),
        ("rotor", "p", library.rotor(j=inertia) if inertia else None),
        ("env", "s", None if heat else library.environment()),
    ):
        if filling is not None:
            boxes[name], fillings[name] = {port: port}, filling
    return System.of(
        Pattern(junctions=junctions, boxes=boxes), {Path.of(name): filling for name, filling in fillings.items()}
    )
