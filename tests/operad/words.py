"""All that the syntax says to people, to be compared with what was read and found good.

``python -m tests.operad.words`` writes it anew into words.json; read the difference before it is committed.
"""

import json
from collections.abc import Callable
from pathlib import Path as File
from typing import Any

from ephs.operad import (
    LAWS,
    ROOT,
    Directory,
    Equation,
    Nesting,
    Path,
    Pattern,
    PatternError,
    PortType,
    Quantity,
    Space,
    junction,
    law,
    quantity,
)
from tests.operad import models
from tests.operad.test_documents import BROKEN, BROKEN_TEXT, FINE, described, junction_of
from tests.operad.test_pattern import ALLOWED, REFUSED, patterns_of
from tests.operad.test_substitution import MISFITS, UPPER

GOLDEN = File(__file__).with_name("words.json")
Q = quantity.displacement
TEXT = "q: displacement, exposed; r: displacement; x.y: pose @ B, exposed as state; a(q, p=~r); b.c(~x.y); b.d(); q ~ r"


def rich() -> Pattern:
    """A pattern with something of everything, made anew."""
    return Pattern.from_text(TEXT)


def odd() -> Pattern:
    """Names that need quotes, letters of many scripts, quantities of every form, several links."""
    return Pattern.from_text(
        """
        "ω(1)".θ: joint_momentum(screw, pitch=0.25)
        漢: {"kind": "St", "space": {"name": "ℝ", "dim": 1, "size": 2, "parameters": {"ä": 1, "b": 2}}, "parity": 1} @ Ü
        a: angle; b: angle; c: charge; d: charge, exposed as state; e: charge; f: entropy
        "box,two"("ω(1)".θ, 漢, x=~a, y=b, c, e, z=~f)
        a ~ b; c ~ d ~ e
        """
    )


def identity() -> Pattern:
    """An identity with a power port and a state port."""
    return Pattern.identity({"q": PortType(Q), "x": PortType(quantity.pose, False)})


def nested() -> Nesting:
    """The damped oscillator on two levels."""
    return Nesting(models.DAMPED, {"osc": models.OSCILLATOR})


def spaced(**space: Any) -> Any:
    """A description whose space is as told."""
    return described(space={"name": "r", "dim": 1, "size": 1} | space)


DOCUMENTS: dict[str, Any] = {
    "document: dim is no whole number": spaced(dim=1.0),
    "document: size is text": spaced(size="1"),
    "document: parity is true": described(parity=True),
    "document: kind is a number": described(kind=5),
    "document: space is a list": described(space=[]),
    "document: space has a key too many": spaced(colour=1),
    "document: space lacks its name": described(space={"dim": 1, "size": 1}),
    "document: space's name is a number": spaced(name=1),
    "document: size less than dim": spaced(dim=2),
    "document: negative dim": spaced(dim=-1),
    "document: parameters are a list": spaced(parameters=[]),
    "document: parameter is text": spaced(parameters={"p": "x"}),
    "document: parameter is true": spaced(parameters={"p": True}),
    "document: parameter is infinite": spaced(parameters={"p": 1e999}),
    "document: pitch is text": junction_of(quantity="relative_pose", pair="screw", pitch="x"),
    "document: pair is a number": junction_of(quantity="relative_pose", pair=1),
    "document: pitch of a hinge": junction_of(quantity="relative_pose", pair="revolute", pitch=1),
    "document: frame is null": junction_of(quantity="pose", frame=None),
    "document: junction is text": FINE | {"junctions": {"q": "displacement"}},
    "document: junction has a key too many": junction_of(quantity="pose", colour=1),
    "document: box is a list": FINE | {"boxes": {"a": []}},
    "document: key is a number": FINE | {"boxes": {1: {}}},
    "document: links are text": FINE | {"links": "q"},
    "document: link of numbers": FINE | {"links": [["q", 1]]},
    "document: identity is a list": {"format": 1, "identity": []},
    "document: identity's port is text": {"format": 1, "identity": {"q": "displacement"}},
    "document: identity's port without quantity": {"format": 1, "identity": {"q": {}}},
    "no long message": FINE | {"format": "n" * 2000},
    "just a long message": FINE | {"format": "n" * 2001},
    "pitch beside a description": junction_of(quantity={}, pitch=1.0),
    "format as a list": FINE | {"format": [1]},
}
TEXTS = ["", "{", '{"format": 1, "format": 1}', '{"a": {"b": 1, "c": 2, "b": 3}}', '{"format": NaN}', "[-Infinity]"]
SHOWN: dict[str, Callable[[], object]] = {
    "pattern": lambda: str(rich()),
    "pattern, repr": lambda: repr(rich()),
    "pattern, text form": lambda: rich().to_text(),
    "pattern, json": lambda: rich().to_json(),
    "pattern, summary": lambda: rich().summary,
    "identity": lambda: str(identity()),
    "identity, repr": lambda: repr(identity()),
    "identity, text form": lambda: identity().to_text(),
    "identity, json": lambda: identity().to_json(),
    "empty pattern": lambda: str(Pattern({}, {})),
    "nesting": lambda: str(nested()),
    "nesting, repr": lambda: repr(nested()),
    "nested nesting": lambda: str(Nesting(Pattern({}, {"a": {}}), {"a": Nesting(Pattern({}, {"b": {}}))})),
    "directory": lambda: str(Directory({"a.b": 1, "c": 2, "a.d.e": 3})),
    "directory, repr": lambda: repr(Directory({"a.b": 1, "c": 2})),
    "directory, nested": lambda: repr(Directory({"a.b": 1, "c": 2, "a.d.e": 3}).to_nested()),
    "directory, empty": lambda: str(Directory({})),
    "directory, root": lambda: str(Directory.unit(5)),
    "path, repr": lambda: repr([ROOT, Path.parse("a.b")]),
    "path, formatted": lambda: f"[{Path.parse('a.b'):>6}]",
    "quantities": lambda: "\n".join(
        f"{q}; {q!r}"
        for q in (
            Q,
            quantity.pose.in_frame("B"),
            quantity.joint_momentum("screw", pitch=0.5),
            Quantity("k", Space("s", 1, 2), 1),
        )
    ),
    "parts": lambda: "\n".join([str(rich().boxes["a"]), *(f"{j}; {j!r}" for j in rich().junctions.values())]),
    "port types": lambda: "\n".join(str(kind) for kind in rich().interface.values()),
    "renaming": lambda: str(
        rich().isomorphic(rich().rename(boxes={"a": "z"}, ports={"a": {"p": "y"}}, junctions={"q": "s"}))
    ),
    "renaming, none": lambda: str(Pattern({}, {}).isomorphic(Pattern({}, {}))),
    "graph": lambda: "\n".join(
        [
            *(
                f"{node} {data | {'state_class': sorted(data['state_class'])} if 'state_class' in data else data}"
                for node, data in rich().to_networkx().nodes(data=True)
            ),
            *(str(edge) for edge in rich().to_networkx().edges(keys=True, data=True)),
        ]
    ),
    "remarks": lambda: "\n".join(f"{name}: {remark}" for name, make in ALLOWED.items() for remark in make().lint()),
    "laws": lambda: "\n".join(f"{each.name} ({', '.join(each.inputs)}): {each.statement}" for each in LAWS),
    "equation that holds": lambda: str(law("left unit")(models.OSCILLATOR)),
    "equation that does not": lambda: str(
        Equation(models.OSCILLATOR, models.DAMPED, "left unit", (models.OSCILLATOR, Path.parse("a")))
    ),
    "odd pattern": lambda: str(odd()),
    "odd pattern, summary": lambda: odd().summary,
    "odd pattern, repr": lambda: repr(odd()),
    "odd pattern, text form": lambda: odd().to_text(),
    "odd pattern, json": lambda: odd().to_json(),
    "description behind a brace": lambda: Pattern.from_text(
        '# {\nq: {"kind": "x", "space": {"name": "r", "dim": 1, "size": 1}, "parity": 1}; a(q)'
    ).to_text(),
    "one junction": lambda: Pattern.from_text("q: angle; a(q)").summary,
    "states without names": lambda: Pattern.from_text("x: angle; y: angle; a(~x); b(~y); state0(~x)").to_json(),
    "states shared with names": lambda: Pattern.from_text(
        "h: angle; q: angle; o: angle, exposed as state; n: angle, exposed as state; a(~h, q); b(~o, ~n); h ~ q; o ~ n"
    ).to_json(),
    "nesting of two, repr": lambda: repr(
        Nesting(Pattern({}, {"a": {}, "b": {}}), {"a": Pattern({}, {}), "b": Pattern({}, {"c": {}})})
    ),
    "canonical hash": lambda: rich().canonical_hash(),
    "canonical hash of the joint": lambda: models.JOINT.canonical_hash(),
    "canonical hash of a chain": lambda: Pattern(
        {f"j{k}": junction(Q) for k in range(9)}, {f"b{k}": {"x": f"j{k}", "y": f"j{k + 1}"} for k in range(8)}
    ).canonical_hash(),
}


def said(make: Callable[[], object]) -> str:
    """The message with which this is refused."""
    try:
        make()
    except PatternError as error:
        facts = {"box": error.box, "port": error.port, "junction": error.junction}
        facts |= {"found": str(error.found)[:300], "expected": str(error.expected)[:300]}
        return f"{error} {[error.kind, facts]}"
    return "nothing is refused"


LONG_TEXTS = {
    "frame without name": "q: angle @ ,",
    "quantity without name": "q: (",
    "name without second part": "q.(x)",
    "name without quotes": '""(x)',
    "argument without name": "q: relative_pose(,)",
    "arguments without end": "q: relative_pose(screw pitch=1)",
    "number in parts": "q: relative_pose(screw, pitch=1.x.2)",
    "identity with links": "q: angle, exposed; r: angle, exposed; .(q, r); q ~ r",
    "second description": 'a({); q: {"kind": "x", "space": {"name": "r", "dim": 1, "size": 1}, "parity": 1}',
    "links of other quantities, two": "a: angle; b: charge; c: angle; d: charge; x(a, b, c, d); c ~ d; a ~ b",
}
LONG: dict[str, Callable[[], object]] = patterns_of(LONG_TEXTS) | {
    "long name": lambda: Path(("n" * 201,)),
    "no long name": lambda: Path(("n" * 200,)),
    "long path": lambda: Path(("n",) * 501),
    "no long path": lambda: Path(("n",) * 500),
    "long message": lambda: Pattern({"q": junction(Q)}, {"a": [f"x{k}" for k in range(1000)]}),
    "path of a number": lambda: Path.of(5),
    "path of text": lambda: Path("ab"),
    "name of a number": lambda: Path((1,)),
    "unprintable name": lambda: Path(("a\x00",)),
    "relative to another": lambda: Path.parse("a.b").relative_to(Path.parse("b")),
    "child of a number": lambda: Nesting(models.DAMPED, {"osc": 1}),
    "child of no box": lambda: Nesting(models.DAMPED, {"oscillator": models.OSCILLATOR}),
    "zip": lambda: Directory({"a": 1, "b": 2}).zip(Directory({"b": 1, "c": 2})),
    "zip, first lacks": lambda: Directory({"b": 2}).zip(Directory({"b": 1, "a": 2})),
    "merge": lambda: Directory({"a": 1}).merge(Directory({"a": 2})),
    "not json": lambda: Pattern.from_json(5),
    "not text": lambda: Pattern.from_text(5),
    "deep json": lambda: Pattern.from_json("[" * 100_000),
    "no utf-8": lambda: Pattern.from_json(b"\xff\xfe\xfa"),
    "too many digits": lambda: Pattern.from_json('{"format": ' + "9" * 5000 + "}"),
    "key given twice, not the first": lambda: Pattern.from_json('{"c": 2, "b": 1, "b": 3}'),
    "box that is no text": lambda: Pattern({"q": junction(Q)}, {"a": [1, 2]}),
    "link to nothing that has a name": lambda: Pattern({}, {"a": {}}, [["p", "q"]]),
    "junction renamed to another's name": lambda: models.DAMPED.rename(junctions={"p": "s"}),
    "no such junction to rename": lambda: models.DAMPED.rename(junctions={"x": "y"}),
    "ports of no such box to rename": lambda: models.DAMPED.rename(ports={"x": {"p": "q"}}),
    "port renamed to another's name": lambda: models.DAMPED.rename(ports={"mf": {"p": "s"}}, boxes={"mf": "friction"}),
    "no such port of an identity": lambda: identity().rename(junctions={"y": "z"}),
    "no such inner port of an identity": lambda: identity().rename(junctions={"q": "z"}, ports={".": {"y": "z"}}),
    "misfit within an identity": lambda: Nesting(
        Pattern.from_text("q: displacement; a(q)"),
        {"a": Nesting(Pattern.identity({"q": PortType(Q)}), {".": Pattern.from_text("q: angle, exposed; b(q)")})},
    ).flatten(),
    "name with a dot": lambda: Path(("a.b",)),
    "name that is a long list": lambda: Path((list(range(1000)),)),
    "link of nothing": lambda: Pattern({}, {"a": {}}, [[]]),
    "clash two levels apart": lambda: Directory({"a": 1, "a.b.c": 2}),
    "clash three levels apart": lambda: Directory({"a": 1, "a.b.c.d": 2}),
    "box filled twice": lambda: models.DAMPED({"mf": 1}, mf=2),
    "child given twice": lambda: Nesting(models.DAMPED, [("osc", models.OSCILLATOR), ("osc", models.OSCILLATOR)]),
    "identity's port given twice": lambda: Pattern.identity([("q", PortType(Q)), ("q", PortType(Q))]),
    "two wrong parameters": lambda: quantity.relative_pose("screw", lead=1.0, angle=2.0),
    "box like one of many junctions": lambda: Pattern(
        {"a": junction(Q), "b": junction(Q)}, {"b": {"x": "a", "y": "b"}, "c": {}}
    ),
    "misfit of an identity": lambda: identity().substitute({".": Pattern.from_text("q: angle, exposed; b(q)")}),
    "nothing to fill": lambda: Pattern({}, {})(),
    "filled by a number": lambda: models.DAMPED(osc=1, mf=2, env=3),
}


def words() -> dict[str, Callable[[], str]]:
    """Everything that is said, by name; said when called."""
    refused: dict[str, Callable[[], object]] = dict(REFUSED)
    refused |= {f"document: {name}": lambda d=d: Pattern.from_dict(d) for name, d in BROKEN.items()}
    refused |= {name: lambda d=d: Pattern.from_dict(d) for name, d in DOCUMENTS.items()}
    refused |= {f"json: {text}": lambda text=text: Pattern.from_json(text) for text in TEXTS}
    refused |= patterns_of({f"text: {text}": text for text in BROKEN_TEXT})
    refused |= {f"filling: {name}": lambda f=f: UPPER.substitute(f) for name, f in MISFITS.items()}
    shown = {f"shown: {name}": lambda make=make: str(make()) for name, make in SHOWN.items()}
    return shown | {f"refused: {name}": lambda make=make: said(make) for name, make in (refused | LONG).items()}


if __name__ == "__main__":
    text = json.dumps({name: say() for name, say in words().items()}, ensure_ascii=False, indent=1)
    GOLDEN.write_text(text + "\n", encoding="utf-8")
