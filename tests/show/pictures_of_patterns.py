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


def body() -> Pattern:
    return Pattern.from_text("q: pose; p: body_momentum, exposed; pe(q); pkc(q, p); ke(p); lp(p)")


def joint() -> Pattern:
    return Pattern.from_text(
        "p_1: body_momentum, exposed; p_2: body_momentum, exposed; p_j1: body_momentum; p_j2: body_momentum; "
        "p_r: joint_momentum(spherical); q_r: relative_pose(spherical); s: entropy; "
        "o_1(p_1, p_j1); o_2(p_2, p_j2); hc(~q_r, p_j1, p_j2, p_r); pe(q_r); pkc(q_r, p_r); mf(p_r, s); env(s)"
    )


def mbs() -> Pattern:
    return Pattern.from_text("p_1: body_momentum; p_2: body_momentum; b1(p=p_1); b2(p=p_2); j(p_1, p_2)")


def flat() -> Pattern:
    """Two bodies on a joint, all on one level: 15 boxes and 9 junctions."""
    return mbs().substitute(b1=body(), b2=body(), j=joint())


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
