"""Systems as documents: what is written is read back equal, without running code; what cannot be written is named."""

import contextlib
import json

import jsonschema
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from referencing import Registry, Resource

import ephs
from ephs import Pattern, PatternError, SemanticsError, System, junction, library
from ephs import quantity as Q
from ephs.mechanics import (
    Shell,
    ShellSection,
    beam_element,
    joint,
    mbs_pattern,
    rigid_body,
    spring_damper,
    stabilised,
    tendon,
)
from ephs.mechanics.elements.beam import hinge_damper
from ephs.mechanics.elements.catalogue import PARTS
from ephs.mechanics.elements.components import pair_spring
from ephs.mechanics.elements.joints import between_frames
from ephs.mechanics.elements.shell.system import shell_system
from ephs.operad import Path
from ephs.operad.documents import SCHEMA_FILE as PATTERN_SCHEMA
from ephs.operad.reading import Reader
from ephs.semantics import Storage
from ephs.semantics.derive.recording import record as recording
from ephs.semantics.documents.catalogue import find_part, part_of
from ephs.semantics.documents.primitives import AGREEMENT, _evaluations
from ephs.semantics.documents.systems import SCHEMA_FILE
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.symbols.terms import DEPTH, OPERATIONS, WrittenFunction, record, recorded, term_from
from ephs.testing import systems
from tests.numerics import largest
from tests.operad.test_documents import places_in
from tests.semantics.test_primitives import ARGUMENTS
from tests.semantics.zoo import drag, friction_matrix

SCHEMA = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
PATTERN = Resource.from_contents(json.loads(PATTERN_SCHEMA.read_text(encoding="utf-8")))
VALID = jsonschema.Draft202012Validator(SCHEMA, registry=Registry().with_resource("pattern.schema.json", PATTERN))
QUARTIC = ephs.storage({"q": Q.displacement}, lambda q: 0.25 * q**4 + 0.1 * np.cos(3.0 * q), name="quartic")


def couple(strength):
    """Components whose formulas hold numbers of their own."""

    def energy(a, b):
        return strength * a**2 * np.exp(-(b**2)) + b**2 / 2 + a**4

    def shared(p, s, x):
        return strength * (1 + x**2) * abs(p) * friction_matrix(p, s)

    def turning(q):
        return 0.5 * strength * (q[1] ** 2 + q[2] ** 2 + q[3] ** 2)

    def spin(x):
        return [[0.0, strength * np.sqrt(1 + x**2)], [-strength * np.sqrt(1 + x**2), 0.0]]

    return [
        ephs.storage({"a": Q.displacement, "b": Q.displacement}, energy),
        ephs.storage({"q": Q.relative_pose("spherical")}, turning),
        ephs.irreversible({"p": Q.momentum, "s": Q.entropy, "~x": Q.displacement}, shared, name="drag"),
        ephs.gyrator({"q": Q.displacement, "p": Q.momentum, "~x": Q.displacement}, spin),
        ephs.gyrator({"q": Q.charge, "p": Q.flux_linkage}, [[0, strength], [-strength, 0]]),
        ephs.transformer(
            {"p": Q.momentum, "r": Q.momentum, "~x": Q.displacement}, lambda x: [[strength * np.tanh(x)]], name="cam"
        ),
        ephs.constraint({"p": Q.momentum, "r": Q.momentum}, [[strength, -1.0]]),
    ]


@st.composite
def written(draw, depth=2):
    """Systems of library parts, parts of mechanics and formulas, some of them used again."""
    strengths = st.floats(0.1, 10.0, allow_subnormal=False)
    names = draw(st.lists(st.sampled_from(library.__all__), min_size=1, max_size=3))
    pool = [getattr(library, name)(**ARGUMENTS[name]) for name in names]
    if draw(st.booleans()):
        pool.append(library.spring(k=draw(strengths)))
    pool += draw(st.lists(st.sampled_from([QUARTIC, *couple(draw(st.sampled_from([0.7, 2.0, 1 / 3])))]), max_size=2))
    mechanics = [
        rigid_body(draw(strengths), [0.3, 0.4, 0.5]),
        joint("planar", friction=0.1),
        joint("revolute", heat=True),
    ]
    pool += draw(st.lists(st.sampled_from(mechanics), max_size=1))
    if depth > 1 and draw(st.booleans()):
        pool += [draw(written(depth=depth - 1))] * 2
    junctions, boxes, parts = {}, {}, {}
    for i, part in enumerate(draw(st.permutations(pool))):
        wires = {}
        for port, kind in part.interface.items():
            alike = [name for name, j in junctions.items() if j.quantity == kind.quantity]
            name = draw(st.sampled_from([*alike, f"j{len(junctions)}"]))
            junctions.setdefault(name, junction(kind.quantity, draw(st.booleans()), draw(st.booleans())))
            wires[port] = f"{'' if kind.power else '~'}{name}"
        boxes[f"b{i}"], parts[f"b{i}"] = wires, part
    return System.of(Pattern(junctions, boxes), parts)


def assert_same(one, two, tolerance=AGREEMENT):
    """Equal as values, and primitive by primitive the same numbers."""
    assert one == two and one.states == two.states
    parts = dict(two.leaves())
    for path, primitive in one.leaves():
        for a, b in zip(_evaluations(primitive, 7), _evaluations(parts[path], 7), strict=True):
            assert np.allclose(a, b, rtol=tolerance, atol=tolerance * largest(a, initial=0.0)), path


@settings(max_examples=25)
@given(written())
def test_what_is_written_is_read_back(system):
    text = system.to_json()
    again = System.from_json(text)
    assert_same(system, again)
    assert again.to_json() == text and again.to_dict() == json.loads(text)
    VALID.validate(system.to_dict())


@settings(max_examples=15)
@given(systems(max_depth=2))
def test_a_drawn_system_is_written_or_refused_by_path(system):
    try:
        text = system.to_json()
    except SemanticsError as error:
        assert error.kind == "unwritten" and Path.parse(error.path) in dict(system.leaves())
        return
    assert_same(system, System.from_json(text))


@settings(max_examples=15)
@given(written(), st.data())
def test_another_number_is_another_system(system, data):
    """The control: a comparison that saw no numbers would pass here, too."""
    document = system.to_dict()
    numbers = [part["parameters"] for part in document["parts"] if "part" in part]
    places = [
        (values, key) for values in numbers for key, value in values.items() if isinstance(value, float) and value
    ]
    assume(places)
    values, key = data.draw(st.sampled_from(places))
    values[key] *= 1.5
    again = System.from_dict(document)
    assert again != system
    with pytest.raises(AssertionError):
        assert_same(system, again)


def alone(primitive):
    """A system of one component."""
    ports = primitive.interface.items()
    wires = {port: f"{'' if kind.power else '~'}j.{port}" for port, kind in ports}
    pattern = Pattern({f"j.{port}": junction(kind.quantity) for port, kind in ports}, {"box": wires})
    return System.of(pattern, {"box": primitive})


@pytest.mark.parametrize("name", library.__all__)
def test_every_library_part_is_written_by_name(name):
    system = alone(getattr(library, name)(**ARGUMENTS[name]))
    assert system.to_dict()["parts"][0]["part"] == name
    assert_same(system, System.from_json(system.to_json()), 0.0)


KINDS = ("revolute", "prismatic", "cylindrical", "planar", "spherical", "fixed", "free", "screw")
ROUND = rigid_body(2.0, [0.1, 0.2, 0.25])
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
TURN, SLIDE = (ephs.quantity.joint_momentum(kind) for kind in ("revolute", "prismatic"))
MECHANICS = [
    *(joint(kind, stiffness=2.0, pitch=0.3) for kind in KINDS),
    joint("revolute", friction=0.1, heat=True),
    rigid_body(2.0, [0.1, 0.2, 0.25]),
    rigid_body(2.0, [0.1, 0.2, 0.25], gravity=[0, 0, 0], group="SO3xR3"),
    spring_damper([0, 0, 0], [0, 0, 1.0], 3.0, 1.0, 0.2),
    beam_element(
        length=2.0,
        stiffness=[5.0, 4.0, 6.0, 1e2, 8e1, 9e1],
        rest=[0.1, 0.0, 0.2, 1.0, 0.0, 0.1],
        damping=0.1,
        expands=True,
    ),
    between_frames(
        SE3.identity(),
        SE3.identity(),
        pair_spring(pair("spherical"), np.array([0.8, 1.0, 2.0]), np.zeros(3)),
        hinge_damper(np.diag([0.1, 0.2, 0.4])),
        kind="spherical",
    ),
    shell_system(Shell.of(SQUARE, [[0, 1, 2, 3]], ShellSection.isotropic(0.1, E=1e3, rho=1.0)), damping=0.1),
    *(tendon([([0, 0, 0], [0, 0, 1.0])], 3.0, 1.0, slack=slack) for slack in (False, True)),
    alone(ephs.mechanics.thermoelastic(capacity=3.0, temperature=310.0, pull=0.4, reference=300.0)),
    stabilised(mbs_pattern()(body1=ROUND, body2=ROUND, joint=joint("revolute"))),
    alone(ephs.mechanics.elements.components.ground()),
    alone(ephs.mechanics.elements.components.thermal_node(3.0, 300.0)),
    alone(ephs.mechanics.armature(TURN, 0.3)),
    *(ephs.mechanics.gear([of, TURN], [2.0], stiffness=3.0, stretch=0.1) for of in (TURN, SLIDE)),
    ephs.mechanics.gas_spring(TURN, area=1e-3, volume=1e-3, pressure=2e5, temperature=300.0),
    ephs.mechanics.hydraulic_cylinder(
        SLIDE, area=[1e-3, 2e-3], volume=[1e-4, 2e-4], bulk=1e9, conductance=1e-10, pressure=[1e5, 0.0]
    ),
]


def test_every_part_of_mechanics_is_written_by_name():
    words = {part["part"] for system in MECHANICS for part in system.to_dict()["parts"] if "part" in part}
    assert {part.word for part in PARTS} <= words
    for system in MECHANICS:
        assert_same(system, System.from_json(system.to_json()), 0.0)


def test_parts_used_again_are_written_once():
    pair = Pattern.from_text("p: momentum, exposed; a(p); b(p)")
    system = pair(a=library.point_mass(m=1.0), b=library.point_mass(m=1.0))
    for _ in range(30):
        system = pair(a=system, b=system)
    document = json.loads(System.to_json(system.fillings["a"].fillings["b"]).replace("\n", ""))
    assert len(document["parts"]) == 1 + 29
    with pytest.raises(PatternError, match="10000000"):
        System.from_json(system.to_json())


def test_a_component_of_the_same_name_is_not_taken_for_the_library_s():
    spring = library.spring(k=2.0)
    stiffer = library.spring(k=3.0)
    forged = Storage(
        "spring", spring.interface, stiffer.energy, stiffer.gradient, stiffer.discrete_gradient, spring.parameters
    )
    assert forged == spring and part_of(spring) is find_part("spring") and part_of(forged) is None
    with pytest.raises(SemanticsError, match=r"box: spring cannot be written: found a primitive without a formula"):
        alone(forged).to_json()


BOUNDED = {
    "storage": lambda: ephs.storage({"q": Q.displacement}, lambda q: q**2, domain={"q": (-1.0, 2.5)}),
    "gyrator": lambda: ephs.gyrator(
        {"q": Q.displacement, "p": Q.momentum, "~a": Q.displacement},
        lambda a: [[0, 1 + a], [-1 - a, 0]],
        domain={"a": (2.0, np.inf)},
    ),
    "constant": lambda: ephs.transformer(
        {"a": Q.momentum, "b": Q.momentum, "~x": Q.displacement}, [[2.0]], domain={"x": (1.5, np.inf)}
    ),
    "irreversible": drag(lambda p, s: 1.0, domain={"p": (3.0, 4.0)}),
}


@pytest.mark.parametrize("make", BOUNDED.values(), ids=BOUNDED)
def test_domains_are_written_and_read_back(make):
    primitive = make()
    system = alone(primitive)
    text = system.to_json()
    VALID.validate(json.loads(text))
    (found,) = System.from_json(text).fillings.values()
    assert found.domain == primitive.domain != ()
    assert System.from_json(text) == system
    assert all(np.all(np.isfinite(part)) for seed in range(3) for part in _evaluations(found, seed))
    broken = text.replace("null", "1.0") if "null" in text else text.replace(str(found.domain[0][2]), '"x"')
    with pytest.raises((PatternError, SemanticsError), match="domain"):
        System.from_json(broken)


@pytest.mark.parametrize("matrix", [[[0.0, 1.0], [-1.0, 0.0]], lambda **_: [[0.0, 1.0], [-1.0, 0.0]]])
def test_only_states_that_are_read_have_a_domain(matrix):
    ports = {"q": Q.displacement, "p": Q.momentum, "~a": Q.displacement}
    with pytest.raises(SemanticsError, match="parameter domain of q is q, expected a"):
        ephs.gyrator(ports, matrix, domain={"q": (0.0, 1.0)})
    inner = ephs.gyrator(ports, matrix, domain={"a": (0.0, 1.0)})
    for a, sound in ((0.5, True), (1.5, False)):
        assert np.isfinite(inner.structure({Path.of("a"): np.array([a])})[0]).all() == sound


def branching(q):
    return q**2 if q > 0 else 2 * q**2


def differing():
    """A component whose formula is not what it does."""
    made = ephs.storage({"q": Q.displacement}, lambda q: q**2)
    return type(made)(
        "storage", made.interface, lambda x: 2.0 * float(x[Path.of("q")][0]) ** 2,
        parameters=made.parameters, formula=made.formula, trusted=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    "primitive, words",
    [
        (lambda: ephs.storage({"q": Q.displacement}, branching), "needs the value of an argument"),
        (differing, "does not say what the component does"),
        (lambda: joint("revolute", potential=lambda x: x[0] ** 2).fillings["pe"], "without a formula"),
    ],
)
def test_what_cannot_be_written_is_refused_by_path(primitive, words):
    with pytest.raises(SemanticsError, match=rf"in\.box: .*{words}"):
        inner = alone(primitive())
        Pattern({}, {"in": {}})({"in": inner}).to_json()


@pytest.mark.parametrize("word", OPERATIONS)
def test_every_operation_is_written_and_read(word):
    """Evaluation, tracing, writing and reading agree, at arguments where all operations are defined."""
    least, _, _ = OPERATIONS[word]
    inner = [["+", 1.5 if word == "acosh" else 0.25, ["*", 0.5, "q"]], ["entry", "r", 1]][:least]
    names = {"q": 1, "r": 2}
    term = term_from(Reader("system"), "here", [word, *inner], names)
    inputs = "q", ("entry", "r", 0), ("entry", "r", 1)
    (again,) = recorded(recording(WrittenFunction(term), {"q": None, "r": 2}), list(inputs))
    x = {"q": 0.3, "r": np.array([0.1, 0.7])}
    assert WrittenFunction(again)(**x) == pytest.approx(WrittenFunction(term)(**x), rel=1e-14)
    assert term_from(Reader("system"), "here", json.loads(json.dumps(record(again))), names) == again


# ---- documents from anybody ---------------------------------------------------------------------------------------

LENGTH = {"quantity": "displacement"}


def document(ports=(("q", LENGTH),), **part):
    """A system whose one component is as told."""
    junctions = {name: {"quantity": port["quantity"]} for name, port in ports}
    wires = {name: f"~{name}" if "exposed" in port else name for name, port in ports}
    pattern = {"format": 1, "junctions": junctions, "boxes": {"a": wires}}
    return {"format": 1, "parts": [{"ports": [*ports], **part}, {"pattern": pattern, "fillings": {"a": 0}}]}


def storage(energy):
    return document(storage="s", energy=energy)


def test_a_document_by_hand():
    assert System.from_dict(document(part="spring", parameters={"k": 1.0})).fillings["a"] == library.spring(k=1.0)
    read = System.from_dict(storage(["+", ["/", ["^", "q", 2], 2], ["-", 1, ["sqrt", 4.0]]]))
    assert read.fillings["a"].energy({Path.of("q"): np.array([3.0])}) == 3.5


@pytest.mark.parametrize("edge", [-3.25, 77.25])
@pytest.mark.parametrize("everywhere", [True, False])
def test_what_holds_beside_the_zero_of_a_sign_only_is_not_proved(edge, everywhere):
    """sign² is 1 but where the sign is 0; it is sign · sign there, too."""
    sign = ["sign", ["-", "x", edge]]
    nothing = ["-", ["*", sign, sign] if everywhere else 1.0, ["^", sign, 2.0]]
    ports = [("q", {"quantity": "momentum"}), ("x", LENGTH | {"exposed": "state"})]
    made = System.from_dict(document(ports, reversible="g", L=[[nothing]])).fillings["a"]
    assert made.verdict == ("proved" if everywhere else "searched")


SPRING, STORED, GYRATOR, FRICTION = (
    json.dumps(document(**part))
    for part in (
        {"part": "spring", "parameters": {"k": 1.0}}, {"storage": "s", "energy": "q"},
        {"reversible": "g", "L": [[0.0]]}, {"irreversible": "m", "M": [[1.0]]},
    )
)  # fmt: skip
PORTS, ENERGY = '["q", {"quantity": "displacement"}]', '"energy": "q"'
BROKEN = [
    (SPRING, SPRING, "[]", r"document: found \[\], expected an object"),
    (SPRING, '{"format": 1, "parts"', '{"format": 2, "parts"', "format: found 2"),
    (SPRING, SPRING, '{"format": 1, "parts": []}', "parts: found no system"),
    (
        SPRING, SPRING[SPRING.index(', {"pattern"') :], "]}",
        "parts: found the primitive spring, expected a system as the last part",
    ),
    (STORED, '"storage": "s", "energy"', '"energy"', r"parts\[0\]: found the keys energy, ports, expected one of"),
    (SPRING, '"part"', '"storage": "s", "part"', r"parts\[0\]: found the keys parameters, part, ports, storage"),
    (SPRING, '"part"', '"colour": 1, "part"', "key colour"),
    (SPRING, '"spring"', '"os.system"', r"parts\[0\]\.part: found os\.system, expected the name of a"),
    (SPRING, '"spring"', '"__class__"', "library part"),
    (SPRING, '"k": 1.0', "", r"parts\[0\]: found .*argument"),
    (SPRING, "1.0", '"stiff"', r"parts\[0\]: "),
    (SPRING, "1.0", "-1", "expected a number > 0"),
    (SPRING, "1.0", "true", r"parameters\.k: found True, expected a number"),
    (SPRING, "1.0", "1e999", "finite"),
    (SPRING, PORTS, '["p", {"quantity": "displacement"}]', r"parts\[0\]\.ports: found p"),
    (SPRING, PORTS, '["q"]', r"ports\[0\]: found 1 entries"),
    (SPRING, PORTS, '["q", {"quantity": "luck"}]', r"ports\[0\]\[1\].*luck"),
    (STORED, ENERGY, '"energy": ["system", "q"]', r"parts\[0\]\.energy\[0\]: found system, expected an operation"),
    (STORED, ENERGY, '"energy": ["^", "q"]', "1 arguments of .*, expected 2"),
    (STORED, ENERGY, '"energy": ["+"]', "0 arguments"),
    (STORED, ENERGY, '"energy": ["^", "q", "r"]', r"energy\[2\]: found r, expected .* port of one number: q"),
    (STORED, ENERGY, '"energy": ["entry", "q", 0]', "several numbers: none"),
    (STORED, ENERGY, '"energy": [["^"], "q"]', "expected an operation"),
    (STORED, ENERGY, '"energy": null', "found None, expected a number"),
    (STORED, ENERGY, '"energy": {"q": 1}', "expected a number"),
    (STORED, ENERGY, '"energy": "__import__(\'os\')"', "name of a port"),
    (STORED, ENERGY, '"energy": ["log", ["-", 0, ["^", "q", 2]]]', r"parts\[0\]"),
    (GYRATOR, "0.0", "1.0", "not reversible"),
    (GYRATOR, "0.0", "0.0], [0.0", r"L: found 2 rows, expected 1"),
    (GYRATOR, '"L": [[0.0]]', '"C": [[0.0, 1.0]]', r"C\[0\]: found 2 entries, expected 1"),
    (FRICTION, FRICTION, FRICTION, "energy is not conserved"),
    (SPRING, SPRING, '{"format": 1, "parts": [{"pattern": {}, "fillings": {}}]}', r"\[0\]\.pattern: .*no key format"),
    (SPRING, '"fillings": {"a": 0}', '"fillings": {"a": 1}', r"fillings\.a: found 1, expected the number"),
    (SPRING, '{"quantity": "displacement"}}, "boxes"', '{"quantity": "charge"}}, "boxes"', "interface"),
]  # fmt: skip
"""A document, a text in it that is another one, and what is said of that."""


@pytest.mark.parametrize(("whole", "old", "new", "words"), BROKEN)
def test_what_is_no_system_is_refused_with_its_place(whole, old, new, words):
    assert old in whole
    with pytest.raises(PatternError, match=words):
        System.from_json(whole.replace(old, new))


def nested(depth, inner="q"):
    for _ in range(depth):
        inner = ["sin", inner]
    return inner


TWO = ["+", ["-", "q", "q"], 1, 1]  # what a computer algebra would keep as an exact number


@pytest.mark.parametrize(
    "energy",
    [
        nested(DEPTH + 1),
        ["+", *["q"] * 20_000],
        ["^", TWO, 1e12],
        ["^", TWO, ["^", TWO, ["^", TWO, 60]]],
        ["exp", ["*", 1e12, ["log", TWO]]],
        ["^", 10, ["^", 10, 10]],
        ["^", 0, -1],
        ["*", "q", ["^", ["^", TWO, 1000], 1000]],
    ],
    ids=str,
)
def test_formulas_that_would_grow_are_read_or_refused(energy):
    with contextlib.suppress(PatternError), np.errstate(all="ignore"):
        System.from_json(json.dumps(storage(energy)))


ANYTHING = st.sampled_from(
    [None, True, -1, 0, 3, 1e300, "q", "spring", "entry", [], {}, [["q"]], ["sin", "q"], ["entry", "q", 1], {"q": 0}]
)
WHOLE = alone(QUARTIC).to_dict(), joint("screw", pitch=0.1, stiffness=1.0).to_dict(), alone(couple(2.0)[2]).to_dict()


@settings(deadline=None)
@given(st.sampled_from(WHOLE), ANYTHING, st.data())
def test_a_damaged_document_is_read_or_refused(whole, junk, data):
    damaged = json.loads(json.dumps(whole))
    *way, last = data.draw(st.sampled_from([place for place in places_in(damaged) if place]))
    spot = damaged
    for key in way:
        spot = spot[key]
    spot[last] = junk
    with contextlib.suppress(PatternError), np.errstate(all="ignore"):
        assert System.from_dict(damaged) is not None
