"""What is put in place of something else: words, numbers and values that programs stumble over."""

from random import Random
from typing import Any

__all__ = ["SPLINTERS", "number", "text", "value"]

NUMBERS: tuple[Any, ...] = (
    0, -0.0, 1, -1, 2, 3, 7, 0.5, 1e-3, 1e3, 1e-8, 1e8, -1e-8, 1e-12, 1e-16, 1e16, 1e-30, 1e30, 1e-100, 1e100, 1e154,
    1e200, 1e308, -1e308, 5e-324, 1e-308, float("nan"), float("inf"), float("-inf"), 2**31, 2**63, -(2**63), 2**64,
    10**40, 10**400, 3.141592653589793, -3.141592653589793, 6.283185307179586, 1e-6, 999999, True, False,
)  # fmt: skip
TEXTS = (
    "", " ", "a", "b", "t", "ground", "environment", "world", "a.b", "a.", ".", "..", "~a", "~", "p.foot", "p.q", "é",
    "\N{GREEK SMALL LETTER LAMDA}",
    "\U0001f600", "\u202e", "\u200b", "\x00", "\x1b[2J", "\n", "\t", "\ud800", "e\u0301",
    "<script>", "</title>", "&", '"', "'", "\\", "%s", "{0}", "{key}", "$x$", "__class__", "nan", "inf", "1e400",
    "0x10",
    "1_000", "leg.toml", "scene.toml", "mesh.stl", "../scene.toml", "none.toml", "pipe.toml", "sub", ".toml",
    "a\x00.toml",
    "model.urdf", "model.xml", "model.sdf", "/", "C:\\a.toml", "package://p/mesh.stl", "model://m/mesh.stl",
    "file:///mesh.stl", "revolute", "prismatic", "spherical", "planar", "cylindrical", "screw", "fixed", "free",
    "universal", "continuous", "floating", "ball", "hinge", "slide", "revolute2", "gearbox", "warn", "nearest",
    "strict", "pose", "momentum", "relative_pose", "displacement", "power", "state", "mesh", "box", "true", "false",
    "__model__", "radian", "degree", "x" * 201, "x" * 5000, "a." * 300 + "a", "0 0 0", "1 0 0", "0 0 1e400",
)  # fmt: skip
SPLINTERS = (
    b"", b"0", b"-", b"-1", b"1e400", b"nan", b"inf", b'"', b"'", b"[", b"]", b"{", b"}", b"<", b">", b"/>", b"<!--",
    b"<!DOCTYPE a>", b"<![CDATA[", b"&lt;", b"&#0;", b"&#x110000;", b"=", b".", b",", b":", b"\n", b"\r", b"\t", b" ",
    b"\x00", b"\xff", b"\xef\xbb\xbf", b"\xc3", b"\xed\xa0\x80", b'"""', b"'''", b"\\u0000", b"\\ud800", b"[[", b"]]",
    b"1979-05-27", b"07:32:00", b"0b1", b"0o7", b"1e", b"~", b";", b"#", b"@", b"a", b"world", b"ground", b"null",
    b"true", b"NaN", b"-Infinity", b"1_0", b"9" * 5000, b"[" * 300, b"{a=" * 300, b"a." * 300, b"<a>" * 300, b"(" * 300,
)  # fmt: skip


def number(random: Random) -> Any:
    """A number, or what some take for one."""
    return (
        random.choice(NUMBERS) if random.random() < 0.8 else random.uniform(-1.0, 1.0) * 10.0 ** random.randint(-9, 9)
    )


def text(random: Random) -> str:
    """A text."""
    if random.random() < 0.9:
        return random.choice(TEXTS)
    return "".join(chr(random.randint(1, 0x2FFF)) for _ in range(random.randint(1, 20)))


def value(random: Random, depth: int = 0) -> Any:
    """Something of any type."""
    match random.randint(0, 9 if depth < 3 else 5):
        case 0 | 1 | 2:
            return number(random)
        case 3 | 4 | 5:
            return text(random)
        case 6:
            return [value(random, depth + 1) for _ in range(random.randint(0, 7))]
        case 7:
            return {text(random): value(random, depth + 1) for _ in range(random.randint(0, 3))}
        case 8:
            return [number(random)] * random.choice((1, 2, 3, 4, 6, 7, 40, 400))
        case _:
            found: Any = number(random)
            for _ in range(random.choice((1, 2, 5, 50, 90))):
                found = [found] if random.random() < 0.5 else {"a": found}
            return found
