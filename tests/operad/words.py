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
from tests.operad.test_documents import BROKEN, BROKEN_TEXT, FINE
from tests.operad.test_pattern import ALLOWED, REFUSED
from tests.operad.test_substitution import MISFITS, UPPER

GOLDEN = File(__file__).with_name("words.json")
Q = quantity.displacement
TEXT = "q: displacement, exposed; r: displacement; x.y: pose @ B, exposed as state; a(q, p=~r); b.c(~x.y); b.d(); q ~ r"


def rich() -> Pattern:
    """A pattern with something of everything, made anew."""
    return Pattern.from_text(TEXT)


def identity() -> Pattern:
    """An identity with a power port and a state port."""
    return Pattern.identity({"q": PortType(Q), "x": PortType(quantity.pose, False)})


def nested() -> Nesting:
    """The damped oscillator on two levels."""
    return Nesting(models.DAMPED, {"osc": models.OSCILLATOR})


def space(**parts: object) -> dict[str, object]:
    """A document whose one quantity is described, with some parts replaced."""
    described = {"kind": "x", "space": {"name": "r", "dim": 1, "size": 1}, "parity": 1}
    return FINE | {"junctions": {"q": {"quantity": described | parts}}}


DOCUMENTS: dict[str, Any] = {
    "document: dim is no whole number": space(space={"name": "r", "dim": 1.0, "size": 1}),
    "document: size is text": space(space={"name": "r", "dim": 1, "size": "1"}),
    "document: parity is true": space(parity=True),
    "document: kind is a number": space(kind=5),
    "document: space is a list": space(space=[]),
    "document: space has a key too many": space(space={"name": "r", "dim": 1, "size": 1, "colour": 1}),
    "document: space lacks its name": space(space={"dim": 1, "size": 1}),
    "document: space's name is a number": space(space={"name": 1, "dim": 1, "size": 1}),
    "document: size less than dim": space(space={"name": "r", "dim": 2, "size": 1}),
    "document: negative dim": space(space={"name": "r", "dim": -1, "size": 1}),
    "document: parameters are a list": space(space={"name": "r", "dim": 1, "size": 1, "parameters": []}),
    "document: parameter is text": space(space={"name": "r", "dim": 1, "size": 1, "parameters": {"p": "x"}}),
    "document: parameter is true": space(space={"name": "r", "dim": 1, "size": 1, "parameters": {"p": True}}),
    "document: parameter is infinite": space(space={"name": "r", "dim": 1, "size": 1, "parameters": {"p": 1e999}}),
    "document: pitch is text": FINE
    | {"junctions": {"q": {"quantity": "relative_pose", "pair": "screw", "pitch": "x"}}},
    "document: pair is a number": FINE | {"junctions": {"q": {"quantity": "relative_pose", "pair": 1}}},
    "document: pitch of a hinge": FINE
    | {"junctions": {"q": {"quantity": "relative_pose", "pair": "revolute", "pitch": 1}}},
    "document: frame is null": FINE | {"junctions": {"q": {"quantity": "pose", "frame": None}}},
    "document: junction is text": FINE | {"junctions": {"q": "displacement"}},
    "document: junction has a key too many": FINE | {"junctions": {"q": {"quantity": "pose", "colour": 1}}},
    "document: box is a list": FINE | {"boxes": {"a": []}},
    "document: key is a number": FINE | {"boxes": {1: {}}},
    "document: links are text": FINE | {"links": "q"},
    "document: link of numbers": FINE | {"links": [["q", 1]]},
    "document: identity is a list": {"format": 1, "identity": []},
    "document: identity's port is text": {"format": 1, "identity": {"q": "displacement"}},
    "document: identity's port without quantity": {"format": 1, "identity": {"q": {}}},
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
    "remarks": lambda: "\n".join(
        f"{name}: {remark}" for name, (make, _) in ALLOWED.items() for remark in make().lint()
    ),
    "laws": lambda: "\n".join(f"{each.name} ({', '.join(each.inputs)}): {each.statement}" for each in LAWS),
    "equation that holds": lambda: str(law("left unit")(models.OSCILLATOR)),
    "equation that does not": lambda: str(
        Equation(models.OSCILLATOR, models.DAMPED, "left unit", (models.OSCILLATOR, Path.parse("a")))
    ),
    "canonical hash": lambda: rich().canonical_hash(),
}


def said(make: Callable[[], object]) -> str:
    """The message with which this is refused."""
    try:
        make()
    except PatternError as error:
        facts = {"box": error.box, "port": error.port, "junction": error.junction}
        return f"{error} {[error.kind, facts]}"
    return "nothing is refused"


LONG: dict[str, Callable[[], object]] = {
    "long name": lambda: Path(("n" * 201,)),
    "no long name": lambda: Path(("n" * 200,)),
    "long path": lambda: Path(("n",) * 501),
    "no long path": lambda: Path(("n",) * 500),
    "long message": lambda: Pattern({"q": junction(Q)}, {"a": [f"x{k}" for k in range(1000)]}),
    "no long message": lambda: Pattern.from_dict(FINE | {"format": "n" * 2000}),
    "just a long message": lambda: Pattern.from_dict(FINE | {"format": "n" * 2001}),
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
    "filled by a number": lambda: models.DAMPED(osc=1, mf=2, env=3),
}


def words() -> dict[str, Callable[[], str]]:
    """Everything that is said, by name; said when called."""
    refused: dict[str, Callable[[], object]] = {name: make for name, (make, _) in REFUSED.items()}
    refused |= {f"document: {name}": lambda d=d: Pattern.from_dict(d) for name, (d, _) in BROKEN.items()}
    refused |= {name: lambda d=d: Pattern.from_dict(d) for name, d in DOCUMENTS.items()}
    refused |= {f"json: {text}": lambda text=text: Pattern.from_json(text) for text in TEXTS}
    refused |= {f"text: {text}": lambda text=text: Pattern.from_text(text) for text in BROKEN_TEXT}
    refused |= {f"filling: {name}": lambda f=f: UPPER.substitute(f) for name, f in MISFITS.items()}
    shown = {f"shown: {name}": lambda make=make: str(make()) for name, make in SHOWN.items()}
    return shown | {f"refused: {name}": lambda make=make: said(make) for name, make in (refused | LONG).items()}


if __name__ == "__main__":
    text = json.dumps({name: say() for name, say in words().items()}, ensure_ascii=False, indent=1)
    GOLDEN.write_text(text + "\n", encoding="utf-8")
