"""Systems beyond mechanics, nested as one would build them: springs, levers, a motor, a cylinder with a piston.

They are the published examples of EPHS.jl, the proof of concept by the authors of the paper, in this package's words.

    ephs run examples/physics.py:cylinder --until 20 --step 0.1 --initial gas1.v=0.1 --initial gas2.v=0.9
"""

from ephs import Pattern
from ephs import library as lib

# Two springs in series bear one force; their lengths add.
springs = Pattern.from_text(
    "q: displacement; q2: displacement; p: momentum; a(q); b(q=q2); sc(q, q2); pkc(q, p); ke(p)"
)(a=lib.spring(k=2.0), b=lib.spring(k=6.0), sc=lib.series_springs(), pkc=lib.pkc(), ke=lib.point_mass(m=1.0))

# Two masses that a rod keeps at one velocity: the rod's force is a multiplier.
masses = Pattern.from_text(
    "q: displacement; p: momentum; p2: momentum; pe(q); pkc(q, p); ke(p); rod(p, p2); other(p=p2)"
)(pe=lib.spring(k=1.5), pkc=lib.pkc(), ke=lib.point_mass(m=0.4), rod=lib.rigid_link(), other=lib.point_mass(m=0.6))

# A spring that a lever joins to the mass, with friction into the environment.
lever = Pattern.from_text(
    "q: displacement; q2: displacement; p: momentum; s: entropy;"
    "lever(q1=q, q2); pe(q=q2); pkc(q, p); ke(p); mf(p, s); env(s)"
)(
    lever=lib.lever(r=2.0),
    pe=lib.spring(k=1.5),
    pkc=lib.pkc(),
    ke=lib.point_mass(m=1.0),
    mf=lib.friction(d=0.1),
    env=lib.environment(),
)

# A shunt motor: the stator's flux, exposed as a state port, is what the rotor's coupling reads.
stator = Pattern.from_text(
    "b: flux_linkage, exposed as state; q: charge, exposed; s: entropy; emc(q, b); coil(b); res(b, s); tc(s)"
)(emc=lib.emc(), coil=lib.inductor(l=1.0), res=lib.resistor(r=0.01), tc=lib.thermal_capacity(c1=1.0, c2=2.0))
rotor = Pattern.from_text(
    "q: charge, exposed; b: flux_linkage; bs: flux_linkage, exposed as state; p: angular_momentum, exposed; s: entropy;"
    "emc(q, b); coil(b); mkc(b, p, ~bs); mass(p); res(b, s); mf(p, s); tc(s)"
)(
    emc=lib.emc(),
    coil=lib.inductor(l=1.0),
    mkc=lib.mkc(),
    mass=lib.rotor(j=1.0),
    res=lib.resistor(r=0.01),
    mf=lib.rotational_friction(d=0.01),
    tc=lib.thermal_capacity(c1=1.0, c2=2.0),
)
motor = Pattern.from_text(
    "q: charge, exposed; bs: flux_linkage; p: angular_momentum, exposed; stator(q, b=~bs); rotor(q, ~bs, p)"
)(stator=stator, rotor=rotor)

# A piston between two gases: volume is exchanged, friction heats the piston, and heat flows into the gases.
piston = Pattern.from_text(
    "v1: volume, exposed; v2: volume, exposed; s1: entropy, exposed; s2: entropy, exposed; s: entropy; p: momentum;"
    "hkc(v1, v2, p); mass(p); mf(p, s); ht1(s1, s2=s); ht2(s1=s2, s2=s); tc(s)"
)(
    hkc=lib.piston(a=0.02),
    mass=lib.point_mass(m=0.5),
    mf=lib.friction(d=0.02),
    ht1=lib.heat_transfer(h=0.01),
    ht2=lib.heat_transfer(h=0.01),
    tc=lib.thermal_capacity(c1=1.0, c2=2.0),
)
gas = lib.ideal_gas(c1=1.0, c2=2.5, v0=1.0, c=1.5)
cylinder = Pattern.from_text(
    "v1: volume; v2: volume; s1: entropy; s2: entropy; gas1(v=v1, s=s1); piston(v1, v2, s1, s2); gas2(v=v2, s=s2)"
)(gas1=gas, piston=piston, gas2=gas)
CYLINDER_START = {"gas1.s": 1.0, "gas1.v": 0.1, "gas2.s": 1.0, "gas2.v": 0.9, "piston.mass.p": 0.0, "piston.tc.s": 1.0}

if __name__ == "__main__":
    import ephs

    solution = ephs.simulate(cylinder, until=200.0, initial=CYLINDER_START, step=0.1)
    energy, entropy = solution.energy, solution.entropy
    print(f"volumes at the end: {solution['gas1.v'][-1]:.4f} and {solution['gas2.v'][-1]:.4f} m³")
    print(f"largest change of energy: {abs(energy - energy[0]).max() / energy[0]:.1e}, relative")
    falls = bool((entropy[1:] < entropy[:-1]).any())
    print(f"entropy grows from {entropy[0]:.4f} to {entropy[-1]:.4f} J/K; it falls: {falls}")
