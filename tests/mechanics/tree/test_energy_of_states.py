"""The energy of circuits, fluids and gases is kept by moving states within the range of their flows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.build import initial_state, scene_system
from ephs.operad import quantity
from ephs.semantics.primitives.primitives import power_ports
from ephs.semantics.primitives.structures import constant_structure, quadratic
from examples import physics
from tests.numerics import EPS, generators, largest
from tests.semantics.test_chemistry import R, Species, vessel
from tests.semantics.test_chemistry import start as filled
from tests.written import scene_of_text

KEEP = {"variational": {"keep": "energy"}}
EVERY = ["auto", *(name for name, method in METHODS.items() if method.scenes and not method.posed)]


def lossless():
    pattern = Pattern.from_text("q: charge; b: flux_linkage; cap(q); coil(b); emc(q, b)")
    return pattern(cap=lib.capacitor(c=0.5), coil=lib.inductor(l=2.0), emc=lib.emc())


def circuit(resistance):
    pattern = Pattern.from_text("q: charge; b: flux_linkage; s: entropy; cap(q); coil(b); emc(q, b); res(b, s); air(s)")
    cap, coil, res = lib.capacitor(c=0.5), lib.inductor(l=2.0), lib.resistor(r=resistance)
    return pattern(cap=cap, coil=coil, emc=lib.emc(), res=res, air=lib.environment())


def tanks():
    pattern = Pattern.from_text(
        "a: liquid; b: liquid; g: pressure_impulse; s: entropy;"
        "tank1(v=a); tank2(v=b); pipe(g); join(v1=a, v2=b, g); loss(g, s); room(s)"
    )
    one, two = (lib.tank(area=area, density=1e3) for area in (2.0, 1.0))
    loss, pipe = lib.pipe_loss(r=2e3, k=5e3), lib.inertance(i=1e5)
    return pattern(tank1=one, tank2=two, pipe=pipe, join=lib.conduit(), loss=loss, room=lib.environment())


CASES = {  # system, start, end of the run and step in s, states of which the sum stays
    "circuit without resistance": (lossless(), {"cap.q": 1.0}, 5.0, 0.1, ()),
    "swinging circuit": (circuit(0.1), {"cap.q": 1.0}, 5.0, 0.1, ()),
    "circuit that only decays": (circuit(8.0), {"cap.q": 1.0}, 5.0, 0.1, ()),
    "tanks": (tanks(), {"tank1.v": 3.0, "tank2.v": 0.5}, 20.0, 0.25, ("tank1.v", "tank2.v")),
    "gases": (physics.cylinder, physics.CYLINDER_START, 0.5, 0.005, ("gas1.v", "gas2.v")),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("method", EVERY)
def test_energy_and_sums_stay(method, case):
    system, start, until, step, summed = CASES[case]
    constant = method != "auto" and not METHODS[method].adaptive
    pace = {"step": step} if constant else {"rtol": 1e-5, "atol": 1e-5}
    sol = ephs.simulate(system, until, initial=start, method=method, options=KEEP.get(method, {}), audit="off", **pace)
    assert sol.energy_error.max() <= 1e-12
    whole = sum((np.ravel(sol[path]) for path in summed), start=np.zeros(len(sol)))
    assert largest(whole - whole[0]) <= 8.0 * len(sol) * EPS * largest(whole)
    if method == "rk54":
        missed = sol.stats["plain_defect"]["largest"] / sol.ledgers.scale
        assert missed > 1e-9, "the control: the steps miss it"


@pytest.mark.parametrize("method", ["rk54", "radau"])
@settings(max_examples=15)
@given(rng=generators, charges=st.integers(1, 5), fluxes=st.integers(1, 5), lossy=st.booleans())
def test_nets_keep_every_sum_that_their_flows_keep(method, rng, charges, fluxes, lossy):
    """Random nets: covectors of a structure's kernel are charges of closed parts, fluxes of closed loops."""
    n = charges + fluxes
    skew = np.zeros((n, n))
    coupling = rng.integers(-1, 2, (charges, fluxes)).astype(float)
    skew[:charges, charges:], skew[charges:, :charges] = coupling, -coupling.T
    names = [f"q{i}" for i in range(charges)] + [f"b{i}" for i in range(fluxes)]
    kinds = [quantity.charge] * charges + [quantity.flux_linkage] * fluxes
    ports = power_ports(**dict(zip(names, kinds, strict=True)))
    stores = {
        f"of_{name}": quadratic(f"of_{name}", power_ports(x=kind), np.array([[size]]), ())
        for name, kind, size in zip(names, kinds, rng.uniform(0.5, 2.0, n), strict=True)
    }
    text = "; ".join(f"{name}: {kind.kind}; of_{name}(x={name})" for name, kind in zip(names, kinds, strict=True))
    boxes, lost = {"net": constant_structure("net", ports, skew, np.zeros((0, n)))}, skew
    if lossy:
        text += f"; s: entropy; loss(b={names[-1]}, s); room(s)"
        boxes |= {"loss": lib.resistor(r=0.3), "room": lib.environment()}
        lost = skew - 0.3 * np.diag(np.arange(n) == n - 1)
    system = Pattern.from_text(f"{text}; net({', '.join(names)})")(**stores, **boxes)
    start = {f"of_{name}.x": value for name, value in zip(names, rng.uniform(-1.0, 1.0, n), strict=True)}
    sol = ephs.simulate(system, 3.0, initial=start, method=method, rtol=1e-5, atol=1e-5, audit="off")
    assert sol.energy_error.max() <= 1e-12
    states = np.array([np.ravel(sol[f"of_{name}.x"]) for name in names])
    u, sigma, _ = np.linalg.svd(lost)
    sums = u[:, sigma <= 1e-12 * max(sigma.max(), 1.0)].T @ states
    rounding = 8.0 * n * len(sol) * EPS * largest(states)
    assert largest(sums - sums[:, :1], initial=0.0) <= rounding


HANGING = """
format = 1
[bodies.bob]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, -1.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "bob"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
"""


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_a_circuit_beside_a_mechanism_at_rest_keeps_its_energy(method):
    """Nothing of the body moves that could take what the circuit's steps miss."""
    scene = scene_of_text(HANGING)
    pattern = Pattern.from_text("q: charge; b: flux_linkage; cap(q); coil(b); emc(q, b); linkage()")
    boxes = {"cap": lib.capacitor(c=0.5), "coil": lib.inductor(l=2.0), "emc": lib.emc()}
    start = {f"linkage.{path}": x for path, x in initial_state(scene).items()} | {"cap.q": 1.0}
    system = pattern(**boxes, linkage=scene_system(scene))
    sol = ephs.simulate(system, 5.0, initial=start, method=method, audit="off", rtol=1e-5, atol=1e-5)
    assert sol.energy_error.max() <= 1e-12
    assert "energy" not in [finding.law for finding in sol.audit.findings]


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "auto"])
def test_a_reaction_keeps_energy_and_atoms(method):
    """2 A = B, with heat, in a vessel: amounts move along the reaction."""
    parts = (
        Species("A", {"X": 1}, entropy=R, capacity=20.0),
        Species("B", {"X": 2}, energy=-4e3, entropy=30.0, capacity=45.0),
    )
    system = vessel(parts, k=5e-3, activation=1e3)
    start = filled(parts, 350.0, 0.02, A=1.0, B=0.1)
    sol = ephs.simulate(system, 5.0, initial=start, method=method, audit="fail", rtol=1e-5, atol=1e-5)
    assert sol.energy_error.max() <= 1e-12
    atoms = np.ravel(sol["mixture.A"]) + 2.0 * np.ravel(sol["mixture.B"])
    assert largest(atoms - 1.2) <= 8.0 * len(sol) * EPS * 1.2
