"""Breaks chosen by hand: each a misunderstanding that one could have of the theory, or a hole in the doors."""

from dataclasses import dataclass

from tests.mutate.mutants import ROOT, Mutant


@dataclass(frozen=True, slots=True)
class Break:
    """One edit: in a file, a text that occurs once becomes another."""

    file: str
    old: str
    new: str


BREAKS = {
    "left trivialisation": Break("ephs/semantics/verdicts/claims.py", '[[0.0, ("-", c), b], ', "[[0.0, c, b], "),
    "slope of a product": Break(
        "ephs/semantics/derive/slopes.py", "a.slopes, b.mean, b.slopes, a.mean", "a.slopes, b.start, b.slopes, a.end"
    ),
    "slope of a quotient": Break(
        "ephs/semantics/derive/slopes.py", "a.slopes, 1.0, b.slopes, -mean", "a.slopes, 1.0, b.slopes, mean"
    ),
    "equations": Break(
        "ephs/semantics/symbols/writer.py",
        "parts.balances[writer.junction(path, port)] += expression",
        "parts.balances[writer.junction(path, port)] -= expression",
    ),
    "dense, axes that turn": Break(
        "ephs/mechanics/road/inverse.py",
        "+ dot(load, bracket(twist, axis))",
        "- dot(load, bracket(twist, axis))",
    ),
    "dense, multipliers": Break("ephs/mechanics/road/closures.py", "scale(-multiplier[row]", "scale(multiplier[row]"),
    "dense, components": Break(
        "ephs/mechanics/tree/sweeps/expanding.py", "value[j] + (by_effort", "value[j] - (by_effort"
    ),
    "totals": Break(
        "ephs/solve/result/entries.py",
        "self.exergy - self.exergy[:1] + self.destroyed",
        "self.exergy - self.exergy[:1] - self.destroyed",
    ),
    "lp": Break("ephs/mechanics/elements/components.py", "[[-_product(column, p)", "[[_product(column, p)"),
    "chord of a rotation": Break("ephs/semantics/derive/charts.py", "chord = 0.5 *", "chord = 0.25 *"),
    "o1": Break("ephs/mechanics/elements/offset.py", "np.hstack([-SE3.adjoint(", "np.hstack([SE3.adjoint("),
    "o1, not inverted": Break(
        "ephs/mechanics/elements/offset.py",
        "SE3.adjoint(SE3.inverse(np.array(offset)))",
        "SE3.adjoint(np.array(offset))",
    ),
    "hc": Break(
        "ephs/mechanics/elements/components.py",
        "np.hstack([SE3.adjoint(SE3.inverse(of.include(x))), -np.eye(6), of.basis])",
        "np.hstack([SE3.adjoint(SE3.inverse(of.include(x))), np.eye(6), of.basis])",
    ),
    "hc, compiled": Break(
        "ephs/semantics/derive/holonomic.py",
        "side, mid, inner = scale(-0.5 * h, two)",
        "side, mid, inner = scale(0.5 * h, two)",
    ),
    "mf": Break("ephs/semantics/primitives/structures.py", "[-pull]", "[pull]"),
    "substitution": Break(
        "ephs/operad/substitution.py",
        "        target[path] = kept = box / path\n",
        "        target[path] = kept = path\n",
    ),
    "substitution, absorbed elsewhere": Break(
        "ephs/operad/substitution.py",
        "target[path] = outer.target[content.ports[path].junction]  # absorbed",
        "target[path] = outer.target[min(content.ports.values(), key=lambda p: p.junction).junction]",
    ),
    "import, angles": Break(
        "ephs/mechanics/imports/draft.py",
        "SE3.compose(_turn(2, given[2]), _turn(1, given[1]))",
        "SE3.compose(_turn(1, given[1]), _turn(2, given[2]))",
    ),
    "import, files outside": Break(
        "ephs/mechanics/imports/draft.py", "file.is_relative_to(folder) and file.is_file()", "file.is_file()"
    ),
    "import, entities": Break(
        "ephs/mechanics/imports/xml.py",
        "if declared := _DECLARATION.search(text):",
        "if declared := None:",
    ),
    "import, welds": Break("ephs/mechanics/imports/mjcf_links.py", "pose(data[3:6], data[6:10])", "pose(data[3:6])"),
    "base, what a part identifies": Break(
        "ephs/semantics/meaning/partition.py", "joined = closure(groups)", "joined = closure(pattern.links)"
    ),
    "base, links of a level": Break(
        "ephs/semantics/meaning/partition.py",
        "groups: list[Iterable[Path]] = list(pattern.links)",
        "groups: list[Iterable[Path]] = []",
    ),
    "base, shown at every outer port of its class": Break(
        "ephs/semantics/meaning/partition.py", "sorted(outer & members)", "sorted(outer & {min(members)})"
    ),
    "base, diagonal": Break("ephs/semantics/meaning/base.py", "if not all(_equal(", "if not any(_equal("),
    "base, states that nobody stores": Break(
        "ephs/semantics/meaning/base.py",
        "states |= dict.fromkeys((*each.stores, *each.readers), values[0][1])",
        "states |= dict.fromkeys((*each.stores, *each.readers), values[0][1] if each.stores else 0.0 * values[0][1])",
    ),
    "rates of a state stored twice": Break(
        "ephs/semantics/meaning/base.py",
        "return {path: each.name for each in classes for path in (*each.stores, *each.readers)}",
        "return {path: path for each in classes for path in (*each.stores, *each.readers)}",
    ),
    "sameness of everything": Break(
        "ephs/semantics/meaning/linear.py",
        "            if self.field.support(row):\n                return False",
        "            if self.field.support(row):\n                return True",
    ),
    "gluing": Break(
        "ephs/semantics/meaning/functor.py",
        "(-1.0, None, port, described)",
        "(1.0, None, port, described)",
    ),
    "gluing, third port": Break(
        "ephs/semantics/meaning/functor.py", "for other in each[1:]]", "for other in each[1:2]]"
    ),
    "gluing, open ports": Break(
        "ephs/semantics/meaning/functor.py",
        "rows.append(field.exact(dict(zip(each, signs, strict=True))))",
        "rows += [field.exact(dict(zip(each, signs, strict=True)))] * (len(signs) > 1)",
    ),
    "emptiness never": Break(
        "ephs/semantics/meaning/posed.py",
        "        return Answer(False)\n    return Answer(True, _cert",
        "        return Answer(False)\n    return Answer(False, _cert",
    ),
    "machine code, fused products": Break(
        "ephs/semantics/stage/emission.py",
        '"+": "fadd", "-": "fsub", "*": "fmul"',
        '"+": "fadd contract", "-": "fsub contract", "*": "fmul contract"',
    ),
    "object code, not whole": Break(
        "ephs/semantics/stage/shipping.py",
        "content is not None and _digest(content) == digest",
        "content is not None",
    ),
    "object code, another processor's": Break(
        "ephs/semantics/stage/objects.py", 'f"+{one}" for one in needs.split()', 'f"+{one}" for one in ""'
    ),
}


def breaks() -> list[Mutant]:
    """The breaks as mutants, named by what is broken."""
    return [_mutant(name, each) for name, each in BREAKS.items()]


def _mutant(name: str, each: Break) -> Mutant:
    text = (ROOT / each.file).read_bytes()
    old, new = each.old.encode(), each.new.encode()
    if text.count(old) != 1:
        raise ValueError(f"{each.file}: {each.old!r} occurs {text.count(old)} times, expected once")
    start = text.index(old)
    lines = text.count(b"\n", 0, start) + 1, text.count(b"\n", 0, start + len(old.rstrip())) + 1
    change = f"{each.old.strip()} → {each.new.strip()}"
    return Mutant(each.file, f"({name})", "named", 1, start, start + len(old), new, lines, change)
