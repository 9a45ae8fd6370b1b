"""Checks of structures: of a primitive by itself, and of entropy production by all components of a system."""

from collections.abc import Callable

from hypothesis import currently_in_test_context, given, reject, settings
from hypothesis import strategies as st

from ephs.semantics import Irreversible, Reference, System
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.laws import random_probe, system_law
from ephs.semantics.systems.probe import Probe
from ephs.semantics.verdicts.search import UNDEFINED, failure, search, shrunk
from ephs.semantics.verdicts.trials import chosen, special_numbers, trial_of
from ephs.semantics.verdicts.verdict import StructureVerdict

Numbers = tuple[list[float], Reference]


@st.composite
def trials(draw: st.DrawFn, primitive: Primitive) -> Numbers:
    """Numbers of states and efforts: temperatures with a < b, a > b, a ≈ b, velocities of both signs, all sizes."""
    return chosen(primitive, lambda among: draw(st.integers(0, among - 1)), special_numbers(primitive))


def check_primitive(primitive: Primitive, *, max_examples: int = 500) -> StructureVerdict:
    """Look for a state and efforts at which a primitive is not the structure that it claims to be.

    They are drawn by Hypothesis, balanced in sign and size of their differences; inside of a test of Hypothesis, where
    no other may run, from a fixed source.

    Returns
    -------
    StructureVerdict
        ``"proved"``, or ``"searched"`` in vain.

    Raises
    ------
    AssertionError
        With the smallest counterexample found.

    Examples
    --------
    >>> from ephs import library
    >>> str(check_primitive(library.friction(d=0.1)))
    'proved'
    """
    try:
        if currently_in_test_context():
            search(primitive, max_examples)
        else:
            _drawn(primitive, max_examples)
        return primitive.verdict
    except StructureError as error:
        raise AssertionError(f"{error.kind}: {error}") from None


def _drawn(primitive: Primitive, max_examples: int) -> None:
    """Raise the smallest failure that Hypothesis finds."""
    found: list[tuple[Numbers, StructureError]] = []

    def holds(numbers: Numbers) -> None:
        error = failure(primitive, trial_of(primitive, *numbers))
        if error is None:
            return
        if error.kind in UNDEFINED:
            reject()
        found.append((numbers, error))
        raise error

    limits = settings(max_examples=max_examples, deadline=None, database=None, derandomize=True, print_blob=False)
    test: Callable[[], None] = limits(given(trials(primitive))(holds))
    try:
        test()
    except StructureError:
        (numbers, reference), error = found[-1]
        raise shrunk(primitive, numbers, reference, error) from None


def check_entropy_production(
    system: System, *, seed: int = 0, reference: Reference | None = None, trials: int = 500
) -> None:
    """Check that no component destroys entropy, and that entropy is balanced.

    Every irreversible component is tried at so many states and efforts, balanced in sign and size of their
    differences; then both laws are measured over a step from a random state.

    Raises
    ------
    AssertionError
        With the component's path and the smallest states and efforts at which it fails, or with the law that fails, the
        state, and how far.
    """
    for path, primitive in system.leaves():
        if isinstance(primitive, Irreversible):
            try:
                search(primitive, trials)
            except StructureError as error:
                raise AssertionError(f"entropy production: {path}: {error}") from None
    probe = random_probe(system, seed, reference=reference)
    for name in ("entropy production", "entropy balance"):
        law = system_law(name)
        verdict = law(probe)
        if not verdict.holds:
            told = f"{verdict.detail}; allowed {verdict.tolerance:.1e}"
            raise AssertionError(f"{law.name}: {law.statement}\n{told}\nat {_told(probe)}\n{system}")


def _told(probe: Probe) -> str:
    """States, and temperatures of the storages of entropy."""
    found: list[str] = []
    for path, primitive in probe.system.leaves():
        if isinstance(primitive, Storage):
            point = {port: probe.state[path / port] for port in primitive.bundle.ports}
            found += [f"{path / port} = {', '.join(f'{v:.4g}' for v in x)}" for port, x in point.items()]
            for _, where, quantity in primitive.bundle.items():
                if quantity.kind == "entropy" and not primitive.environment:
                    found.append(f"{path} at {float(primitive.energy_gradient(point)[where][0]):.5g} K")
    return "; ".join(found)
