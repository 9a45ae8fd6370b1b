"""Checks of algebras of the operad and of maps between them, for other test suites, with their strategies."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, TypeAlias

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from ephs.operad import (
    ALGEBRA_LAWS,
    MAP_LAWS,
    Algebra,
    AlgebraMap,
    Directory,
    Interface,
    Law,
    Path,
    Pattern,
    Quantity,
)
from ephs.testing.laws import renamings
from ephs.testing.patterns import fresh_paths, nestings, patterns
from ephs.testing.patterns import quantities as any_quantities

Elements: TypeAlias = Callable[[Interface], st.SearchStrategy[Any]]
"""Interface -> elements of it."""


def check_algebra(
    algebra: Algebra[Any],
    fillings_strategy: Elements,
    *,
    quantities: st.SearchStrategy[Quantity] | None = None,
    max_examples: int = 50,
) -> None:
    """Check every law of algebras on drawn patterns, nestings and fillings.

    Parameters
    ----------
    fillings_strategy
        Called with an interface; a strategy for elements that have it.
    quantities
        Of the ports that are drawn; any where not given. Few of them make many junctions alike.

    Raises
    ------
    AssertionError
        With both sides of the smallest instance found that does not hold.

    Examples
    --------
    >>> from hypothesis import strategies as st
    >>> from ephs.semantics.algebra import Corelation, corelations
    >>> check_algebra(corelations, lambda interface: st.just(Corelation.of(interface)), max_examples=5)
    """
    for law in ALGEBRA_LAWS:
        _check(law, algebra_inputs(law, algebra, fillings_strategy, quantities=quantities), max_examples)


def check_algebra_map(
    alpha: AlgebraMap[Any, Any],
    fillings_strategy: Elements,
    *,
    quantities: st.SearchStrategy[Quantity] | None = None,
    max_examples: int = 50,
) -> None:
    """Check that a map of algebras keeps interfaces and commutes with every pattern.

    Parameters
    ----------
    fillings_strategy, quantities
        As of `check_algebra`: elements of the source.

    Raises
    ------
    AssertionError
        With both sides of the smallest square found that does not commute.
    """
    for law in MAP_LAWS:
        _check(law, algebra_inputs(law, alpha, fillings_strategy, quantities=quantities), max_examples)


@st.composite
def algebra_inputs(
    draw: st.DrawFn,
    law: Law,
    subject: Algebra[Any] | AlgebraMap[Any, Any],
    fillings_strategy: Elements,
    *,
    quantities: st.SearchStrategy[Quantity] | None = None,
) -> tuple[object, ...]:
    """Inputs of a law of algebras or maps: patterns or a nesting, elements for all boxes, new names."""
    wanted = law.inputs
    known: dict[str, Any] = {"algebra": subject, "map": subject}
    if quantities is None and draw(st.booleans()):
        # one or two, so that most junctions can be linked, three of them and more
        quantities = st.sampled_from(draw(st.lists(any_quantities(), min_size=1, max_size=2)))
    if "nesting" in wanted:
        known["nesting"] = draw(nestings(of=quantities))
        known["elements"] = _elements(draw, known["nesting"].flatten(), fillings_strategy)
        return tuple(known[name] for name in wanted)
    named = {"boxes", "junctions", "ports"} & set(wanted)
    f = draw(patterns(min_boxes=int("a" in wanted), identities=not named and law.name != "nullary", of=quantities))
    if law.name == "nullary":
        (a,) = fresh_paths(draw, 1, [*f.boxes, *f.junctions])
        f = Pattern(f.junctions, [*f.boxes.items(), (a, Directory({}))], f.links)
    elif "a" in wanted:
        a = draw(st.sampled_from(list(f.boxes)))
    else:
        a = Path()
    whole = f
    if "g" in wanted:
        known["g"] = draw(patterns(interface=f.boxes[a].interface, of=quantities))
        whole = f.substitute({a: known["g"]})
    elif law.name == "nullary":
        whole = f.substitute({a: Pattern({}, {})})
    if "again" in wanted:
        known["again"] = _again(draw, f)
    if "boxes" in wanted:
        known["boxes"] = renamings(draw, f.boxes, [*f.boxes, *f.junctions])
    if "junctions" in wanted:
        known["junctions"] = renamings(draw, f.junctions, [*f.boxes, *f.junctions])
    if "ports" in wanted:
        known["ports"] = renamings(draw, f.boxes[a].interface, f.boxes[a].interface)
    known |= {"f": f, "a": a, "elements": _elements(draw, whole, fillings_strategy)}
    return tuple(known[name] for name in wanted)


def _elements(draw: st.DrawFn, pattern: Pattern, fillings_strategy: Elements) -> Mapping[Path, Any]:
    return {box: draw(fillings_strategy(content.interface)) for box, content in pattern.boxes.items()}


def _again(draw: st.DrawFn, f: Pattern) -> Pattern:
    """The pattern, its parts listed in another order."""
    if f.is_identity:
        return Pattern.identity(draw(st.permutations(list(f.interface.items()))))
    boxes = [(box, Directory(draw(st.permutations(list(of.ports.items()))))) for box, of in f.boxes.items()]
    links = [pair for group in f.links for pair in pairwise(draw(st.permutations(sorted(group))))]
    junctions = draw(st.permutations(list(f.junctions.items())))
    return Pattern(junctions, draw(st.permutations(boxes)), links)


def _check(law: Law, inputs: st.SearchStrategy[tuple[object, ...]], max_examples: int) -> None:
    # whole patterns are drawn and composed: what Hypothesis deems slow and large is meant
    calm = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]
    limits = settings(
        max_examples=max_examples,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=calm,
    )

    def holds(drawn: tuple[object, ...]) -> None:
        equation = law(*drawn)
        if not equation.holds:
            raise AssertionError(f"{law.name}: {law.statement}\n{equation}")

    limits(given(inputs)(holds))()
