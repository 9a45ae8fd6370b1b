"""Options of a method's run: those that the method has, and that the problem lets it honour."""

from collections.abc import Mapping
from typing import Any
from warnings import warn

from ephs.mechanics.methods.registry import REPLACED, MethodEntry
from ephs.solve.posing.errors import OptionError, nearest_of
from ephs.solve.posing.problem import Problem


def options_of(method: MethodEntry, problem: Problem, given: Mapping[str, Any] | None) -> dict[str, Any]:
    """The options of a run.

    Raises
    ------
    OptionError
        They are no mapping, the method has no such option, or steps with impulses cannot keep what is asked for.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise OptionError("options", given, "a mapping from names to values")
    if "rho" in given and method.name == REPLACED["alpha"]:
        warn("option 'rho' was one of alpha; radau damps all that its steps do not resolve", FutureWarning, 4)
        given = {key: value for key, value in given.items() if key != "rho"}
    if unknown := [key for key in given if key not in method.options]:
        known = ", ".join(method.options) or "none"
        raise OptionError(
            "options", unknown[0], f"options of {method.name}: {known}{nearest_of(unknown[0], method.options)}"
        )
    hard = problem.descriptor.strikes
    if hard is not None and given:
        from ephs.mechanics.tree.equations.accounts import KEEP  # only mechanisms have impulses

        energy, both = KEEP
        if given.get("keep") == both:
            expected = f"{energy!r}: {hard} acts by impulses, beside which steps keep no momenta"
            raise OptionError("options['keep']", both, expected)
    return dict(given)
