"""Systems linearised: closed forms, differences of rates, and interconnection, with which linearising commutes."""

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.linalg import block_diag

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.mechanics.linear.modes import modes_of
from ephs.mechanics.linear.pencil import Pencil, system_problem
from ephs.mechanics.linear.structure import laws_of
from ephs.operad import quantity
from ephs.semantics.primitives.primitives import power_ports
from ephs.semantics.primitives.structures import constant_structure, quadratic
from ephs.testing import systems
from examples import physics
from tests.numerics import jacobian, largest
from tests.oscillator import oscillator

MASS = oscillator(m=2.0)
SHAKER = Pattern.from_text("q: displacement; p: momentum, exposed; s: entropy; pe(q); pkc(q, p); mf(p, s); env(s)")(
    pe=lib.spring(k=0.7), pkc=lib.pkc(), mf=lib.friction(d=0.3), env=lib.environment()
)


def eigenvalues(matrix):
    return np.sort_complex(np.linalg.eigvals(matrix))


@settings(max_examples=15)
@given(system=systems(max_depth=2))
def test_where_there_is_a_structure_its_laws_hold(system):
    try:
        found = ephs.linearize(system)
    except (ephs.OptionError, ephs.SimulationError) as error:  # states that the outer inputs hold, or no motion
        assert "derivative" in str(error) or "determine" in str(error) or "state" in str(error)
        return
    except ephs.AssemblyError as error:
        assert "expected a number > 0" in str(error)  # a volume starts nowhere
        return
    for law in found.laws:
        assert law.holds(2e-9), (law.name, law.defect)


@pytest.mark.parametrize("seed", [15, 19, 29])  # eliminations leave 6e-16, 7e-17, 2e-16 of B
def test_an_input_that_acts_on_nothing_is_seen_in_nothing(seed):
    """Heat put into the environment: B and C are rounding of what they were solved together with."""
    rng, swing = np.random.default_rng(seed), np.zeros((4, 4))
    for i, j in ((0, 1), (0, 3), (1, 2), (2, 3)):
        swing[i, j] = rng.standard_normal()
    held = np.array([[0.0, *(rng.standard_normal(2)[:, None] * [1.0, 0.0]).ravel()]])
    names = {"q": quantity.displacement, "p": quantity.momentum, "x": quantity.displacement, "y": quantity.momentum}
    skew = np.zeros((5, 5))
    skew[1:, 1:] = swing - swing.T
    stores = {
        f"store_{name}": quadratic(f"store_{name}", power_ports(**{name: kind}), np.array([[size]]), ())
        for (name, kind), size in zip(names.items(), rng.uniform(0.5, 2.0, 4), strict=True)
    }
    tie = constant_structure("tie", power_ports(s=quantity.entropy, **names), skew, held)
    pattern = Pattern.from_text(
        "s: entropy, exposed; q: displacement; p: momentum; x: displacement; y: momentum;"
        "env(s); store_q(q); store_p(p); store_x(x); store_y(y); tie(s, q, p, x, y)"
    )
    found = ephs.linearize(pattern(env=lib.environment(), tie=tie, **stores))
    assert found.structure is not None and largest(found.B) < 1e-14 and largest(found.C) < 1e-14
    assert all(law.holds() for law in found.laws), [(law.name, law.defect) for law in found.laws]
    for off in (np.zeros_like(found.C), 1e-6 * np.ones_like(found.C)):
        laws = laws_of(found.A, found.B, found.C + off, found.D, found.structure, found.sizes, conjugate=True)
        assert all(law.holds() for law in laws) == (not off.any())


def test_rates_differ_as_the_matrix_says_away_from_equilibrium():
    """A motor in motion: its coupling and its heat depend on the state."""
    start = {"stator.coil.b": 0.3, "rotor.coil.b": 0.2, "rotor.mass.p": 0.1, "rotor.tc.s": 0.1}
    inputs = {"q": {"effort": 1.0}}
    found = ephs.linearize(physics.motor, start, inputs=inputs)
    problem = system_problem(physics.motor, start, inputs, None)
    pencil, x = Pencil(problem), problem.descriptor.pack(problem.initial)

    def rates(step):
        return pencil.unknowns(x + step)[: pencil.n_w]

    assert largest(found.A - jacobian(rates, x.size, 2e-3, 1)) < 1e-10
    assert found.structure is None and "depends on the state" in found.reason


def test_a_resonant_circuit_has_the_transfer_of_the_book():
    """A voltage u on a capacitor, an inductor and a resistor in series: 1/(l s + r + 1/(c s))."""
    r, coil, c = 0.4, 2.0, 0.5
    series = Pattern.from_text(
        "q: charge; b: flux_linkage, exposed; s: entropy; cap(q); coil(b); emc(q, b); res(b, s); env(s)"
    )(cap=lib.capacitor(c=c), coil=lib.inductor(l=coil), emc=lib.emc(), res=lib.resistor(r=r), env=lib.environment())
    found = ephs.linearize(series)
    for s in (0.3j, 1j, 2.0 + 1j):
        assert found.transfer(s)[0, 0] == pytest.approx(1.0 / (coil * s + r + 1.0 / (c * s)), rel=1e-12)
    (mode,) = found.modes
    assert abs(mode.eigenvalue) == pytest.approx(1.0 / np.sqrt(coil * c), rel=1e-12)
    assert mode.damping == pytest.approx(0.5 * r * np.sqrt(c / coil), rel=1e-12)


@pytest.mark.parametrize(("system", "omega"), [("springs", np.sqrt(1.5)), ("masses", np.sqrt(1.5))])
def test_what_constraints_join_is_one_state(system, omega):
    """Springs in series, masses on a rod: three storages, two states."""
    found = ephs.linearize(getattr(physics, system))
    assert found.A.shape == (2, 2)
    assert found.eigenvalues.imag.max() == pytest.approx(omega, rel=1e-12) and np.all(found.eigenvalues.real == 0.0)


def test_inductors_in_one_loop_carry_one_current():
    """A junction without storage holds the states beside it: what is eliminated there constrains."""
    loop = Pattern.from_text(
        "q: charge; b1: flux_linkage; b2: flux_linkage; q0: charge;"
        "l1(b=b1); l2(b=b2); c(q=q0); e1(q, b=b1); e2(q, b=b2); e0(q=q0, b=b1)"
    )(l1=lib.inductor(l=1.0), l2=lib.inductor(l=3.0), c=lib.capacitor(c=0.25), e1=lib.emc(), e2=lib.emc(), e0=lib.emc())
    found = ephs.linearize(loop)
    assert found.structure is not None and all(law.holds() for law in found.laws)
    assert found.A.shape == (2, 2)
    assert found.eigenvalues.imag.max() == pytest.approx(1.0, rel=1e-12)


def test_linearising_commutes_with_interconnecting():
    """A mass whose force is given, and what its velocity drives: each linearised, then joined; or joined first."""
    joined = Pattern.from_text("p: momentum; mass(p); shaker(p)")(mass=MASS, shaker=SHAKER)
    one, two = ephs.linearize(MASS), ephs.linearize(SHAKER, inputs={"p": {"effort": 0.0}})
    assert largest(one.D) == 0.0
    # u₁ = −y₂, u₂ = y₁ = C₁ x₁
    feedback = np.block([[one.A - one.B @ two.D @ one.C, -one.B @ two.C], [two.B @ one.C, two.A]])
    whole = ephs.linearize(joined)
    assert largest(eigenvalues(whole.A) - eigenvalues(feedback)) < 1e-12
    order = [f"mass.{name}" for name in one.states] + [f"shaker.{name}" for name in two.states]
    places = [whole.states.index(name) for name in order]
    assert largest(whole.A[np.ix_(places, places)] - feedback) < 1e-12
    # The structures join as well: exergies add, dissipation adds where the ports meet.
    assert largest(whole.Q[np.ix_(places, places)] - np.diag([1.5, 0.5, 0.7])) < 1e-12
    assert whole.R[places[1], places[1]] == pytest.approx(0.3)


def test_flattening_changes_nothing():
    found, flat = ephs.linearize(physics.lever), ephs.linearize(physics.lever.flatten())
    assert found.states == flat.states and np.array_equal(found.A, flat.A)


def test_a_gas_settles_and_swings_about_that():
    rest = ephs.equilibrium(physics.cylinder, initial=physics.CYLINDER_START)
    values = {str(path): float(value[0]) for path, value in rest.states.items()}
    assert values["gas1.v"] == pytest.approx(0.5) and values["gas2.v"] == pytest.approx(0.5)
    found = ephs.linearize(physics.cylinder, rest)
    assert found.stable and all(law.holds() for law in found.laws)
    pushed = found.film(len(found.modes) - 1, amplitude=0.05, frames=11)
    assert np.ptp(pushed["gas1.v"] + pushed["gas2.v"]) < 1e-12 < np.ptp(pushed["gas1.v"])


def test_a_spring_settles_under_its_load():
    damped = Pattern.from_text("p: momentum, exposed; s: entropy; osc(p); mf(p, s); env(s)")(
        osc=MASS, mf=lib.friction(d=0.2), env=lib.environment()
    )
    rest = ephs.equilibrium(damped, inputs={"p": {"flow": 3.0}})
    values = {str(path): float(value[0]) for path, value in rest.states.items()}
    assert values["osc.pe.q"] == pytest.approx(2.0, rel=1e-12) and abs(values["osc.ke.p"]) < 1e-12


@pytest.mark.parametrize(
    ("keys", "what"),
    [({"inputs": {"p": {"effort": 0.0}}}, "derivative"), ({"inputs": {"p": {"flow": lambda t: t}}}, "constants"),
     ({"outputs": ["pe.p"]}, "did you mean"), ({"inputs": ["p"]}, "effort")],
)  # fmt: skip
def test_what_cannot_be_is_named(keys, what):
    with pytest.raises(ephs.OptionError, match=what):
        ephs.linearize(MASS, **keys)


@pytest.mark.parametrize("s", [2.0j, "2", np.nan, [1.0j], None])
def test_where_there_is_no_response_is_said(s):
    found = ephs.linearize(oscillator(k=4.0, m=1.0), inputs={"p": {"flow": 0.0}})
    assert found.transfer(1.0j)[0, 0] == pytest.approx(1.0j / 3.0, rel=1e-12)
    with pytest.raises(ephs.OptionError, match="s is"):
        found.transfer(s)


@pytest.mark.parametrize("seed", range(5))
def test_slow_modes_beside_fast_ones_are_those_of_their_own(seed):
    """λ² + 2 ζ ω λ + ω² = 0 of each oscillator, ω by up to ten decades apart; a free one has two zeros."""
    rng = np.random.default_rng(seed)
    slow, damping = 10.0 ** rng.uniform(-5.0, 2.0), [0.0, 0.05, 0.7, 3.0, 1.0][seed]
    free = np.array([[0.0, 1.0], [0.0, 0.0]])

    def oscillator(omega, damping):
        return np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])

    A = block_diag(oscillator(1e5, 0.01), oscillator(slow, damping), free)
    turned = np.linalg.qr(rng.standard_normal((2, 2)))[0]
    A[4:, 4:] = 3e3 * turned @ free @ turned.T
    found = modes_of(A, {})
    assert [mode.eigenvalue for mode in found[:2]] == [0.0, 0.0]
    root = slow * np.sqrt(complex(damping**2 - 1.0))
    wanted = [-damping * slow + root] if damping < 1.0 else [-damping * slow + root, -damping * slow - root]
    rounding = 1e-11 * slow if damping != 1.0 else 1e-7 * slow  # a double one, to the root
    assert len(found) == 3 + len(wanted)
    assert largest(np.array([mode.eigenvalue for mode in found[2:-1]]) - wanted) <= rounding


def test_double_real_eigenvalues_are_not_oscillations():
    """Rounding splits them into pairs whose imaginary parts are roots of it."""
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    found = modes_of(turn @ np.array([[-1.0, 1.0], [0.0, -1.0]]) @ turn.T, {})
    assert [mode.frequency for mode in found] == [0.0, 0.0]
    swinging = modes_of(np.array([[-1.0, 1e-3], [-1e-3, -1.0]]), {})
    assert [mode.frequency > 0.0 for mode in swinging] == [True]


@pytest.mark.parametrize("place", [0.0, 0.75])
@pytest.mark.parametrize("power", [1.0, 1.3, 1.9, 2.25, 3.0])
def test_a_state_at_a_kink_has_no_linear_system(power, place):
    """|q − c|ᵖ at c: its effort jumps for p = 1, its stiffness is infinite for p < 2, and 0 beyond."""
    spring = ephs.storage({"q": quantity.displacement}, lambda q: abs(q - place) ** power)
    system = Pattern.from_text("q: displacement; p: momentum; spring(q); mass(p); turn(q, p)")(
        spring=spring, mass=lib.point_mass(m=1.0), turn=lib.pkc()
    )
    beside = ephs.linearize(system, {"spring.q": place + 0.25}).A
    stiffness = power * (power - 1.0) * 0.25 ** (power - 2.0)
    np.testing.assert_allclose(beside, [[0.0, 1.0], [-stiffness, 0.0]], atol=1e-12 * power**2)
    if power > 2.0:
        assert largest(ephs.linearize(system, {"spring.q": place}).A - [[0.0, 1.0], [0.0, 0.0]]) < 1e-12
    else:
        with pytest.raises(ephs.OptionError, match=r"spring\.q at a kink"):
            ephs.linearize(system, {"spring.q": place})


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-5, 1e-6])
def test_a_constraint_that_cannot_be_recorded_is_differenced_over_its_own_length(size):
    """Two masses on a curve of waves: of a micrometre, which are shorter than any difference, they are wrong."""

    def linear(place):
        waves = ephs.constraint(
            {"a": quantity.momentum, "b": quantity.momentum, "~q": quantity.displacement},
            lambda q: [[1.0 + 0.3 * np.sin(place(q) / size), 1.0]], multipliers=1,
        )  # fmt: skip
        system = Pattern.from_text(
            "q: displacement; a: momentum; b: momentum; pe(q); pkc(q, p=a); m(p=a); n(p=b); w(a, b, ~q)"
        )(pe=lib.spring(k=1.0), pkc=lib.pkc(), m=lib.point_mass(m=1.0), n=lib.point_mass(m=1.0), w=waves)
        return ephs.linearize(system, {"pe.q": 0.3 * size, "m.p": 1.0, "n.p": -1.0 - 0.3 * np.sin(0.3)}).A

    exact = linear(lambda q: q)
    assert (largest(linear(float) - exact) <= 1e-6 * largest(exact)) == (size > 1e-6)


@pytest.mark.parametrize("beside", [0.0, 1e-9, 0.1, -1.0, 100.0])
@pytest.mark.parametrize("entropy", [0.0, -0.05])
def test_a_temperature_near_that_of_the_environment_is_no_kink(beside, entropy):
    """What rounds is the temperature, not the effort: with ṡ₁ = h (θ₂ − θ₁)/θ₁, ∂ṡ₁/∂s₁ = −h θ₂/(c θ₁)."""
    c, h, other = 12.9, 0.3, 300.0
    system = Pattern.from_text("s: entropy; z: entropy; one(s); two(s=z); wall(s1=s, s2=z)")(
        one=lib.thermal_capacity(capacity=c, temperature=293.15 + beside),
        two=lib.thermal_capacity(capacity=3.0, temperature=other), wall=lib.heat_transfer(h=h),
    )  # fmt: skip
    own = (293.15 + beside) * np.exp(entropy / c)
    found = ephs.linearize(system, {"one.s": entropy}).A
    exact = [[-h * other / (c * own), h * other / (3.0 * own)], [h * own / (c * other), -h * own / (3.0 * other)]]
    np.testing.assert_allclose(found, exact, rtol=1e-12)


@pytest.mark.parametrize(
    ("energy", "at", "stiffness"),
    [
        (lambda q: 25.0 * (abs(q - 1.0) + q - 1.0) ** 2, 1.5, 200.0),
        (lambda q: (abs(q - 40.0) + q - 40.0) ** 3, 40.5, 24.0),
        (lambda q: 3.0 * q**2 + 5.0 * (abs(q + 30.0) - q - 30.0) ** 2, -31.0, 46.0),
        (lambda q: -np.exp(-60.0 * (q - 30.0) ** 2), 30.0, 120.0),
    ],
)
def test_parts_that_act_on_one_side_have_their_stiffness_there(energy, at, stiffness):
    """Wherever that is: what is flat at drawn states need not be flat at others."""
    swing = Pattern.from_text("q: displacement; p: momentum; pe(q); pkc(q, p); ke(p)")
    spring = ephs.storage({"q": quantity.displacement}, energy, name="one-sided")
    system = swing(pe=spring, pkc=lib.pkc(), ke=lib.point_mass(m=2.0))
    found = eigenvalues(ephs.linearize(system, {"pe.q": at}).A)
    assert found.imag == pytest.approx(np.sqrt(0.5 * stiffness) * np.array([-1.0, 1.0]), rel=1e-9)
    assert largest(found.real) <= 1e-9
