"""Printed equations: those of the paper come out, and numbers put into them give what the solver computes."""

import numpy as np
import pytest
import sympy as sp

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements.joints import mbs_pattern
from ephs.operad import Path
from ephs.semantics import AssemblyError, Reference
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.meaning.step import solved
from ephs.semantics.primitives.behaviour import ContinuousBehaviour
from ephs.semantics.symbols.algebra import text_of
from ephs.semantics.symbols.words import Words, operator, pairing
from examples import oscillator, physics
from tests.semantics.zoo import drag

FORMS = ("relation", "descriptor", "reduced")
SYSTEMS = {name: system for name, system in vars(physics).items() if isinstance(system, ephs.System)}
BODY = rigid_body(2.0, [1.0, 2.0, 3.0])
JOINT = joint("spherical", friction=0.1, stiffness=1.0)
MBS = mbs_pattern()(body1=BODY, body2=BODY, joint=JOINT)
OSCILLATOR = oscillator.oscillator(pe=lib.spring(k=1.5), ke=lib.point_mass(m=2.0), pkc=lib.pkc())
DAMPED = oscillator.damped(osc=OSCILLATOR, mf=lib.friction(d=0.1), env=lib.environment())


class Paper:
    """The paper's notation as expressions."""

    def __init__(self):
        self.words = Words()

    def vector(self, name):
        return sp.Symbol(name, commutative=False)

    def number(self, name, positive=None):
        return sp.Symbol(name, real=True, positive=positive)

    def label(self, path):
        return self.words.label(Path.of(path))

    def carried(self, star, element):
        return operator(star, element)

    def momentum(self, p, q, body, force):
        """ṗ = ad*_u p − T*_eL_q(f_q) + force, with u = 𝕀⁻¹p (eq. body)."""
        u = operator("inertia", self.label(f"{body}ke")) * p
        weight = operator("cotangent", q) * operator("differential", self.label(f"{body}pe"), q)
        return operator("ad*", u) * p - weight + force


def same(found, expected):
    assert sp.expand(found - expected) == 0, f"{text_of(found)}\nexpected {text_of(expected)}"


def sides(equations):
    """(left, right) of the equations with a left side, and the right sides of those that are zero."""
    named = {text_of(row.left): row.right for row in equations if row.left != 0}
    return named, [row.right for row in equations if row.left == 0]


def test_the_oscillator_of_the_paper():
    """Equations osc_pe, osc_ke, osc_pkc, osc_pattern and osc."""
    w = Paper()
    k, m, q, p = w.number("k", True), w.number("m", True), w.number("q"), w.number("p")
    relation = [(text_of(row.left), text_of(row.right)) for row in OSCILLATOR.equations("relation")]
    assert relation == [
        ("pe.q.x", "pkc.q.x"), ("pe.q.f + pkc.q.f", "0"), ("pe.q.e", "pkc.q.e"),
        ("ke.p.x", "pkc.p.x"), ("pkc.p.x", "p.x"), ("ke.p.f + pkc.p.f", "p.f"), ("ke.p.e", "pkc.p.e"),
        ("pkc.p.e", "p.e"),
        ("pe.q.x", "q"), ("pe.q.f", "dq/dt"), ("pe.q.e", "k*q"),
        ("ke.p.x", "p"), ("ke.p.f", "dp/dt"), ("ke.p.e", "p/m"),
        ("pkc.q.f", "-pkc.p.e"), ("pkc.p.f", "pkc.q.e"),
    ]  # fmt: skip
    named, conditions = sides(OSCILLATOR.equations())
    assert (set(named), conditions) == ({"dq/dt", "dp/dt", "p.e"}, [])
    same(named["dq/dt"], p / m)
    same(named["p.e"], p / m)
    same(named["dp/dt"], -k * q + w.number("p.f"))


def test_the_joint_of_the_paper():
    """Equations joint_pe, joint_pkc, joint_o1, joint_hc, joint_mf and joint; λ as errata 3 and 4 have it."""
    w = Paper()
    q_r, u_r, lam = w.vector("q_r"), w.vector("p_r.e"), w.vector("lambda[hc]")
    one, two, relative = w.vector("o1"), w.vector("o2"), operator("group", w.vector("q_r"))
    named, conditions = sides(JOINT.equations())
    assert set(named) == {"dq_r/dt", "ds/dt", "p1.f", "p2.f"}
    same(named["dq_r/dt"], operator("tangent", q_r) * u_r)
    same(named["ds/dt"], pairing(w.label("mf"), u_r, u_r) / sp.Symbol("theta_0", positive=True))
    balance, constraint = conditions
    spring = operator("cotangent", q_r) * operator("differential", w.label("pe"), q_r)
    same(balance, spring + operator("include*", w.label("hc")) * lam + operator("metric", w.label("mf")) * u_r)
    carried = operator("Ad", relative) * operator("Ad", one) * w.vector("p1.e")
    same(constraint, carried - operator("Ad", two) * w.vector("p2.e") + operator("include", w.label("hc")) * u_r)
    same(named["p1.f"], operator("Ad*", one) * operator("Ad*", relative) * lam)
    same(named["p2.f"], -operator("Ad*", two) * lam)


def test_the_multibody_system_of_the_paper():
    """The flattened system, its constraint with the inverses of erratum 1."""
    w = Paper()
    p1, p2, q1, q2 = (w.vector(name) for name in ("p1", "p2", "body1.q", "body2.q"))
    q_r, u_r, lam = w.vector("joint.q_r"), w.vector("joint.p_r.e"), w.vector("lambda[joint.hc]")
    one, two, relative = w.vector("joint.o1"), w.vector("joint.o2"), operator("group", w.vector("joint.q_r"))
    u1, u2 = (operator("inertia", w.label(f"body{i}.ke")) * p for i, p in ((1, p1), (2, p2)))
    named, conditions = sides(MBS.equations())
    assert set(named) == {f"d{x}/dt" for x in ("body1.q", "p1", "body2.q", "p2", "joint.q_r", "joint.s")}
    same(named["dbody1.q/dt"], operator("tangent", q1) * u1)
    same(named["dp1/dt"], w.momentum(p1, q1, "body1.", -operator("Ad*", one) * operator("Ad*", relative) * lam))
    same(named["dp2/dt"], w.momentum(p2, q2, "body2.", operator("Ad*", two) * lam))
    same(named["djoint.q_r/dt"], operator("tangent", q_r) * u_r)
    _, constraint = conditions
    carried = operator("Ad", relative) * operator("Ad", one) * u1
    same(constraint, carried - operator("Ad", two) * u2 + operator("include", w.label("joint.hc")) * u_r)


def named_numbers(system, state, reference):
    """Numbers by the names that equations call parameters and states by."""
    values = {"theta_0": reference.temperature, "pi_0": reference.pressure}
    flat = system.flatten()
    for path, primitive in flat.leaves():
        for key, number in primitive.parameters:
            values |= {key: number, f"{path}.{key}": number}
        for port in primitive.bundle.ports if primitive.kind in ("storage", "environment") else ():
            values[str(flat.pattern.boxes[path].ports[port].junction)] = float(state[path / port][0])
    return values


def evaluated(expression, values):
    """A number, every symbol of the expression being known."""
    return float(expression.subs({symbol: values[symbol.name] for symbol in expression.free_symbols}))


CLOSED = [name for name, system in SYSTEMS.items() if all(port.power for port in system.interface.values())]


def drawn_point(name, seed):
    """A system, a source of numbers, its reference, and a state of positive numbers."""
    rng = np.random.default_rng(seed)
    state = {path: np.exp(0.3 * rng.standard_normal(1)) for path in SYSTEMS[name].states}
    return SYSTEMS[name], rng, Reference(293.15, 300.0), state


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("seed", range(3))
def test_numbers_in_the_descriptor_form_give_its_residual(name, seed):
    """At any rates, efforts, multipliers and flows, whether or not they solve the equations."""
    system, rng, reference, state = drawn_point(name, seed)
    d = system.descriptor()
    inputs = {slot.path: Input(rng.standard_normal(1), False) for slot in d.outer}
    z = rng.standard_normal(d.unknowns(inputs))
    residual = d.residual(ContinuousBehaviour(reference), d.pack(state), inputs, z)
    values = named_numbers(system, state, reference)
    values |= {f"d{where}/dt": z[s.rate] for s, where in zip(d.states, _junctions(system), strict=True)}
    values |= {f"{s.path}.e": z[d.rate_size + s.at] for s in d.junctions}
    values |= {f"{path}.f": float(given.value[0]) for path, given in inputs.items()}
    for slot in d.components:
        lam = z[d.rate_size + d.effort_size + slot.multiplier :][: slot.multipliers]
        values |= {f"lambda[{slot.path}]": lam[0]} if lam.size == 1 else {}
        values |= {f"lambda_{i + 1}[{slot.path}]": entry for i, entry in enumerate(lam)}
    found = [evaluated(row.left - row.right, values) for row in system.equations("descriptor")]
    assert np.allclose(np.abs(found), np.abs(residual), rtol=1e-12, atol=1e-11)


def _junctions(system):
    flat = system.flatten().pattern
    for path in system.states:
        box = max((b for b in flat.boxes if b.is_prefix_of(path)), key=len)
        yield flat.boxes[box].ports[path.relative_to(box)].junction


@pytest.mark.parametrize("name", ["lever", "stator", "motor", "piston", "cylinder"])
@pytest.mark.parametrize("seed", range(3))
def test_numbers_in_the_reduced_form_give_what_the_solver_computes(name, seed):
    system, rng, reference, state = drawn_point(name, seed)
    stored = set(_junctions(system))
    inputs = {slot.path: Input(rng.standard_normal(1), slot.path not in stored) for slot in system.descriptor().outer}
    found = solved(system, state, ContinuousBehaviour(reference), inputs)
    values = named_numbers(system, state, reference)
    for path, where in zip(system.states, _junctions(system), strict=True):
        values[f"d{where}/dt"] = float(found.rates[path][0])
    values |= {f"lambda[{path}]": float(lam[0]) for path, lam in found.multipliers.items()}
    for path, (flow, effort) in found.outer.items():
        values |= {f"{path}.f": float(flow[0]), f"{path}.e": float(effort[0])}
    for row in system.equations():
        unknown = {s.name for s in (row.left - row.right).free_symbols} - set(values)
        assert not unknown
        left, right = evaluated(row.left, values), evaluated(row.right, values)
        assert abs(left - right) <= 1e-8 * (1.0 + abs(left) + abs(right)), text_of(row.right)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("system", [OSCILLATOR, DAMPED, BODY, JOINT, MBS, *SYSTEMS.values()])
def test_every_form_prints_as_text_and_as_latex(system, form):
    found = system.equations(form)
    text, latex = str(found), found.latex()
    assert len(found) == sum(line.startswith("  ") for line in text.splitlines())
    assert latex.count(r"\\") >= len(found)
    assert latex.startswith(r"\begin{align*}")
    assert latex.count("{") == latex.count("}")
    assert found._repr_latex_().startswith("$")


def test_an_equation_is_found_by_its_left_side():
    assert text_of(OSCILLATOR.equations()["dq/dt"]) == "p/m"
    with pytest.raises(KeyError, match="the left sides are dq/dt"):
        OSCILLATOR.equations()["nothing"]
    with pytest.raises(ValueError, match="form is 'tidy', expected one of relation"):
        OSCILLATOR.equations("tidy")


def test_what_has_no_square_form_has_its_relation():
    two = Pattern.from_text("q: displacement; a(q); b(q)")
    springs = two(a=lib.spring(k=1.0), b=lib.spring(k=2.0))
    assert "a.k*q" in str(springs.equations("relation"))
    with pytest.raises(AssemblyError, match="stored twice"):
        springs.equations()


def test_functions_of_ones_own_are_written_out():
    swing = ephs.storage({"q": Q.displacement}, lambda q: 2.5 * (1.0 - np.cos(q)))
    pendulum = oscillator.closed(osc=oscillator.oscillator(pe=swing, ke=lib.point_mass(m=1.0), pkc=lib.pkc()))
    assert text_of(pendulum.equations()["dp/dt"]) == "-5*sin(osc.q)/2"
    opaque = ephs.storage({"q": Q.displacement}, lambda q: float(q) ** 2)
    system = oscillator.closed(osc=oscillator.oscillator(pe=opaque, ke=lib.point_mass(m=1.0), pkc=lib.pkc()))
    assert text_of(system.equations()["dp/dt"]) == "-dE[osc.pe]/dosc.q(osc.q)"


def test_drag_keeps_the_sign_of_the_velocity():
    """|u| u is not u²: velocities have either sign, temperatures one."""

    brake = drag(lambda p, s: 0.2 * abs(p))()
    system = oscillator.damped(osc=OSCILLATOR, mf=brake, env=lib.environment())
    assert "Abs(p)" in text_of(system.equations()["dp/dt"])
    m, p = sp.Symbol("m", positive=True), sp.Symbol("p", real=True)
    slowing = system.equations()["dp/dt"].subs({sp.Symbol("osc.q", real=True): 0})
    assert sp.simplify(slowing + sp.Abs(p) * p / (5 * m**2)) == 0
