"""Patterns to draw: those of the body, the joint and two bodies on a joint, and a few awkward ones."""

from ephs.operad import Pattern, junction, quantity

KINDS = {
    "pe": "storage",
    "ke": "storage",
    "pkc": "reversible",
    "lp": "reversible",
    "o_1": "reversible",
    "o_2": "reversible",
    "hc": "reversible",
    "mf": "irreversible",
    "env": "environment",
}

MOMENTUM = quantity.body_momentum
POSE = quantity.pose

BODY_BOXES = {"pe": {"q": "q"}, "pkc": {"q": "q", "p": "p"}, "ke": {"p": "p"}, "lp": {"p": "p"}}
JOINT_BOXES = {
    "o_1": {"p_1": "p_1", "p_j1": "p_j1"},
    "o_2": {"p_2": "p_2", "p_j2": "p_j2"},
    "hc": {"q_r": "~q_r", "p_j1": "p_j1", "p_j2": "p_j2", "p_r": "p_r"},
    "pe": {"q_r": "q_r"},
    "pkc": {"q_r": "q_r", "p_r": "p_r"},
    "mf": {"p_r": "p_r", "s": "s"},
    "env": {"s": "s"},
}
JOINT_QUANTITIES = {
    "p_j1": MOMENTUM,
    "p_j2": MOMENTUM,
    "p_r": quantity.joint_momentum("spherical"),
    "q_r": quantity.relative_pose("spherical"),
    "s": quantity.entropy,
}


def body() -> Pattern:
    return Pattern({"q": junction(POSE), "p": junction(MOMENTUM, exposed=True)}, BODY_BOXES)


def joint() -> Pattern:
    outer = {"p_1": junction(MOMENTUM, exposed=True), "p_2": junction(MOMENTUM, exposed=True)}
    return Pattern(outer | {name: junction(q) for name, q in JOINT_QUANTITIES.items()}, JOINT_BOXES)


def mbs() -> Pattern:
    boxes = {"b1": {"p": "p_1"}, "b2": {"p": "p_2"}, "j": {"p_1": "p_1", "p_2": "p_2"}}
    return Pattern({"p_1": junction(MOMENTUM), "p_2": junction(MOMENTUM)}, boxes)


def flat() -> Pattern:
    """Two bodies on a joint, all on one level: 15 boxes and 9 junctions."""
    junctions = {
        "p_1": junction(MOMENTUM),
        "p_2": junction(MOMENTUM),
        "b1.q": junction(POSE),
        "b2.q": junction(POSE),
    }
    junctions |= {f"j.{name}": junction(q) for name, q in JOINT_QUANTITIES.items()}
    boxes: dict[str, dict[str, str]] = {}
    for k in "12":
        there = {"q": f"b{k}.q", "p": f"p_{k}"}
        boxes |= {f"b{k}.{box}": {port: there[j] for port, j in ports.items()} for box, ports in BODY_BOXES.items()}
    for box, ports in JOINT_BOXES.items():
        boxes[f"j.{box}"] = {port: _inside(name) for port, name in ports.items()}
    return Pattern(junctions, boxes)


def _inside(name: str) -> str:
    state, plain = name.startswith("~"), name.lstrip("~")
    path = plain if plain in ("p_1", "p_2") else f"j.{plain}"
    return f"~{path}" if state else path


def awkward() -> Pattern:
    """Two ports of a box on one junction, a state link, an outer state port, a box without ports, a long name."""
    junctions = {
        "a": junction(POSE, exposed=True, power=False),
        "b": junction(POSE),
        "c": junction(MOMENTUM, exposed=True),
    }
    boxes = {
        "two_ports": {"x": "a", "y": "a", "z": "b"},
        "long.name.of_a_box": {"b": "b", "c": "~c"},
        "mono": {"c": "c"},
        "lonely": {},
    }
    return Pattern(junctions, boxes, links=[("a", "b")])


def grid(rows: int, columns: int) -> Pattern:
    """A net of boxes with a junction between any two neighbours: many loops."""
    boxes: dict[str, dict[str, str]] = {f"n{r}{c}": {} for r in range(rows) for c in range(columns)}
    junctions = {}
    for r in range(rows):
        for c in range(columns):
            for name, end in (("h", (r, c + 1)), ("v", (r + 1, c))):
                if end[0] < rows and end[1] < columns:
                    junctions[f"{name}{r}{c}"] = junction(MOMENTUM)
                    boxes[f"n{r}{c}"][f"{name}1"] = f"{name}{r}{c}"
                    boxes[f"n{end[0]}{end[1]}"][f"{name}2"] = f"{name}{r}{c}"
    return Pattern(junctions, boxes)


def star(arms: int) -> Pattern:
    """A box with many ports, each of them exposed as well."""
    junctions = {f"p{k}": junction(MOMENTUM, exposed=True) for k in range(arms)}
    boxes = {"hub": {f"p{k}": f"p{k}" for k in range(arms)}}
    return Pattern(junctions, boxes | {f"arm{k}": {"p": f"p{k}"} for k in range(arms)})


PICTURES = {
    "body": body,
    "joint": joint,
    "mbs": mbs,
    "flat": flat,
    "awkward": awkward,
    "grid": lambda: grid(3, 4),
    "star": lambda: star(6),
    "empty": lambda: Pattern({}, {}),
}


def kinds_of(pattern: Pattern) -> dict[str, str]:
    return {str(box): KINDS.get(str(box).rpartition(".")[2], "composite") for box in pattern.boxes}
