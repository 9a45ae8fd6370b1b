"""Strategies for the laws of the operad, and a check of all laws."""

from collections.abc import Callable, Iterable

from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.operad import LAWS, Law, Path, Pattern
from ephs.testing.patterns import fresh_paths, nestings, patterns


@st.composite
def law_inputs(draw: st.DrawFn, law: Law) -> tuple[object, ...]:
    """Inputs of the law: patterns that fit, names of boxes, fillings in any order, new names."""
    wanted = law.inputs
    if wanted == ("nesting",):
        return (draw(nestings()),)
    renamed = {"boxes", "junctions", "ports"} & set(wanted)
    known: dict[str, object] = {}
    boxes = 2 if "c" in wanted else 1 if "a" in wanted else 0
    if "f" in wanted:
        f = draw(patterns(min_boxes=boxes, identities=not renamed))
        known["f"] = f
        if "fillings" in wanted:
            known["fillings"] = _fillings(draw, f)
        if "a" in wanted:
            a = draw(st.sampled_from(list(f.boxes)))
            # An identity's junctions cannot be renamed.
            g = draw(
                patterns(
                    interface=f.boxes[a].interface,
                    min_boxes=int("b" in wanted),
                    identities="ports" not in wanted,
                )
            )
            known |= {"a": a, "g": g}
            if "b" in wanted:
                known["b"] = b = draw(st.sampled_from(list(g.boxes)))
                known["h"] = draw(patterns(interface=g.boxes[b].interface))
            if "c" in wanted:
                known["c"] = c = draw(st.sampled_from([box for box in f.boxes if box != a]))
                known["h"] = draw(patterns(interface=f.boxes[c].interface))
            if "boxes" in wanted:
                known["boxes"] = renamings(draw, f.boxes, [*f.boxes, *f.junctions])
            if "junctions" in wanted:
                known["junctions"] = renamings(draw, f.junctions, [*f.boxes, *f.junctions])
            if "ports" in wanted:
                known["ports"] = renamings(draw, g.interface, [*g.boxes, *g.junctions])
    else:
        known["g"] = draw(patterns())
    return tuple(known[name] for name in wanted)


def _fillings(draw: st.DrawFn, pattern: Pattern) -> dict[Path, Pattern]:
    order = draw(st.permutations(list(pattern.boxes)))
    count = draw(st.integers(0, len(order)))
    return {box: draw(patterns(interface=pattern.boxes[box].interface)) for box in order[:count]}


def renamings(draw: st.DrawFn, names: Iterable[Path], taken: Iterable[Path]) -> dict[Path, Path]:
    """Swap names, and behind a choice give one of them a name that is new."""
    old = list(names)
    new = list(draw(st.permutations(old)))
    if new and draw(st.booleans()):
        new[0] = fresh_paths(draw, 1, taken)[0]
    return dict(zip(old, new, strict=True))


def check_operad_laws(*, max_examples: int = 100) -> None:
    """Check every law of the operad on drawn patterns.

    Raises
    ------
    AssertionError
        With both sides of the smallest equation found that does not hold.
    """
    limits = settings(max_examples=max_examples, deadline=None, database=None)
    for law in LAWS:
        limits(given(law_inputs(law))(_check_of(law)))()


def _check_of(law: Law) -> Callable[[tuple[object, ...]], None]:
    def holds(inputs: tuple[object, ...]) -> None:
        equation = law(*inputs)
        if not equation.holds:
            raise AssertionError(f"{law.name}: {law.statement}\n{equation}")

    return holds
