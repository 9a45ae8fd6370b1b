"""Guesses of unknowns from those of former steps, and limits of a change of unknowns."""

from collections.abc import Sequence
from typing import Final

from ephs.semantics.stage import Evaluator, Integer, Matrix, Real
from ephs.solve.methods.places import Part, each_component
from ephs.solve.methods.records import STORING, Columns
from ephs.solve.methods.scales import FAR

RULES: Final = (
    (2.0, -1.0),
    (4.0, -6.0, 4.0, -1.0),
    (6.0, -15.0, 20.0, -15.0, 6.0, -1.0),
    (2.0, 0.0, -2.0, 1.0),
    (4.0, -5.0, 0.0, 5.0, -4.0, 1.0),
    (2.0, 1.0, -4.0, 1.0, 2.0, -1.0),
)
"""Weights of the last values in a guess of the next, exact for polynomials of degree 1, 3 and 5, and of degree 2, 4 and
3 with an alternating part of degree 0, 0 and 1: multipliers of joints alternate from step to step."""
BEFORE: Final = max(map(len, RULES))
"""Number of steps before the last whose unknowns are kept to choose among the rules."""


def extrapolated(on: Evaluator, values: Sequence[Real], others: Sequence[tuple[Real, Real]] = ()) -> Real:
    """Guess of the value after these, latest first, by the rule whose guess of the latest one had the least error.

    Parameters
    ----------
    others
        Error and guess of other rules.
    """
    latest, guess, least = values[0], on.variable(values[0]), on.variable(FAR)
    found = [(on.absolute(latest - _combined(rule, values[1:])), _combined(rule, values)) for rule in RULES]
    for error, ahead in (*others, *found):
        closer = error < least.value
        guess.value = on.select(closer, ahead, guess.value)
        least.value = on.select(closer, error, least.value)
    return guess.value


def _combined(rule: Sequence[float], values: Sequence[Real]) -> Real:
    terms = [coefficient * value for coefficient, value in zip(rule, values, strict=False) if coefficient]
    return sum(terms[1:], start=terms[0])


def restrain(on: Evaluator, t: Columns, z: Matrix, step: Matrix) -> Real:
    """Shorten a Newton step z − step (stages, unknowns) storage by storage; the least part taken of efforts and rates.

    Absolute temperatures fall by half or rise fourfold at most: small heat capacities warm by orders of magnitude in
    one step of the method, where whole Newton steps would leave what is positive. All stages take the same part, as the
    states at each depend on the rates at all.
    """
    least, share = on.variable(1.0), on.variable(1.0)

    def storing(part: Part) -> None:
        def effort(j: Integer) -> None:
            at, row = part.effort(j), part.balance(j)

            def stage(k: Integer) -> None:
                warmth, fall = z[k, row] + t.intensive[at], step[k, row]

                def limit(bound: Real) -> None:
                    share.value = on.minimum(share.value, bound / fall)

                def warm() -> None:
                    for falls, bound in ((fall > 0.5 * warmth, 0.5), (fall < -3.0 * warmth, -3.0)):
                        on.when(falls, lambda bound=bound: limit(bound * warmth))

                on.when(warmth > 0.0, warm)

            on.when(t.entropy[at] > 0.0, lambda: on.loop(z.rows, stage))

        def shorten() -> None:
            least.value = on.minimum(least.value, share.value)

            def port(j: Integer) -> None:
                def stage(k: Integer) -> None:
                    for place in (part.balance(j), part.rate(j)):
                        step[k, place] = step[k, place] * share.value

                on.loop(z.rows, stage)

            on.loop(part.n, port)

        share.value = 1.0
        on.loop(part.n, effort)
        on.when(share.value < 1.0, shorten)

    each_component(on, t, STORING, storing)
    return least.value
