"""Patterns as text: a tree to read, an expression that evaluates back, and one line."""

from collections.abc import Iterator, Mapping
from typing import cast

from ephs.operad.names import Path
from ephs.operad.parts import Port
from ephs.operad.pattern import Pattern


def tree(pattern: Pattern) -> str:
    """The pattern as an indented tree of junctions, boxes and links."""
    lines = [summary(pattern)]
    sections = (
        ("junctions", pattern.junctions.to_nested()),
        ("boxes", pattern.boxes.map(lambda box: box.ports).map(_ports_text).to_nested()),
    )
    for title, nested in sections:
        if nested:
            lines += [f"  {title}", *_branches(nested, "    ")]
    if pattern.links:
        lines += ["  links", *(f"    {group}" for group in _links(pattern, " ~ "))]
    return "\n".join(lines)


def _ports_text(ports: Mapping[Path, Port]) -> str:
    return ", ".join(f"{name} on {port}" for name, port in ports.items()) or "no ports"


def _branches(nested: Mapping[str, object], indent: str) -> Iterator[str]:
    for name, value in nested.items():
        if isinstance(value, dict):
            yield f"{indent}{name}"
            yield from _branches(cast("dict[str, object]", value), indent + "  ")
        else:
            yield f"{indent}{name}: {value}"


def summary(pattern: Pattern) -> str:
    """The pattern in one line."""
    kind = "Identity" if pattern.is_identity else "Pattern"
    counts = [
        _count(len(pattern.boxes), "box", "boxes"),
        _count(len(pattern.junctions), "junction", "junctions"),
    ]
    if pattern.links:
        counts.append(_count(len(pattern.links), "link", "links"))
    ports = ", ".join(f"{'' if t.power else '~'}{port}" for port, t in pattern.interface.items())
    return f"{kind} of {', '.join(counts)}; " + (f"outer ports {ports}" if ports else "no outer port")


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _links(pattern: Pattern, separator: str) -> list[str]:
    return [separator.join(map(str, group)) for group in sorted(sorted(group) for group in pattern.links)]


def expression(pattern: Pattern) -> str:
    """The pattern as an expression in the public names, which evaluates to an equal pattern."""
    if pattern.is_identity:
        ports = ", ".join(f"{str(port)!r}: {kind!r}" for port, kind in pattern.interface.items())
        return f"Pattern.identity({{{ports}}})"
    junctions = ", ".join(f"{str(path)!r}: {value!r}" for path, value in pattern.junctions.items())
    boxes: list[str] = []
    for box, content in pattern.boxes.items():
        ports = ", ".join(f"{str(name)!r}: {str(port)!r}" for name, port in content.ports.items())
        boxes.append(f"{str(box)!r}: {{{ports}}}")
    groups = sorted([str(path) for path in sorted(group)] for group in pattern.links)
    links = f", links={groups!r}" if groups else ""
    return f"Pattern(junctions={{{junctions}}}, boxes={{{', '.join(boxes)}}}{links})"
