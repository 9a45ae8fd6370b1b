"""Coefficients of the staged elementary functions in 60 digits: ``python -m tests.semantics.stage.coefficients``.

Each polynomial interpolates at Chebyshev points of the interval in which it is used, which is within a small factor of
the best one.
"""

from collections.abc import Callable
from typing import Any

from mpmath import mp, mpf

mp.dps = 60


def interpolated(function: Callable[[Any], Any], low: Any, high: Any, count: int) -> tuple[float, ...]:
    """Coefficients of the polynomial through `count` Chebyshev points."""
    nodes = [(low + high) / 2 + (high - low) / 2 * mp.cos(mp.pi * (2 * k + 1) / (2 * count)) for k in range(count)]
    matrix = mp.matrix(count, count)
    for i, node in enumerate(nodes):
        for j in range(count):
            matrix[i, j] = node**j
    found = mp.lu_solve(matrix, mp.matrix([function(node) for node in nodes]))
    return tuple(float(each) for each in found)


def sine(z: Any) -> Any:
    """(sin √z ∕ √z − 1) ∕ z."""
    x = mp.sqrt(z)
    return (mp.sin(x) / x - 1) / z


def cosine(z: Any) -> Any:
    """(cos √z − 1 + z ∕ 2) ∕ z²."""
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def exponential(r: Any) -> Any:
    """(eʳ − 1 − r) ∕ r²."""
    return (mp.exp(r) - 1 - r) / r**2 if r else mpf("0.5")


def logarithm(z: Any) -> Any:
    """(2 artanh √z ∕ √z − 2) ∕ z."""
    s = mp.sqrt(z)
    return (2 * mp.atanh(s) / s - 2) / z


def arctangent(z: Any) -> Any:
    """(atan √z ∕ √z − 1) ∕ z."""
    u = mp.sqrt(z)
    return (mp.atan(u) / u - 1) / z


def parts(number: Any, *bits: int) -> tuple[float, ...]:
    """A number as a sum of floats, truncated to so many bits each; the last one has all."""
    out: list[float] = []
    for count in bits:
        unit = mpf(2) ** (int(mp.floor(mp.log(number, 2))) + 1 - count)
        part = mp.floor(number / unit) * unit
        out.append(float(part))
        number -= part
    return (*out, float(number))


def made() -> dict[str, Any]:
    """All constants of the module by their names."""
    quarter, edge = mp.pi / 4, mp.log(2) / 2
    s = (mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)
    halves = [(float(a), float(a - mpf(float(a)))) for a in (mp.atan(mpf(1) / 2), mp.atan(1))]
    return {
        "QUARTERS": parts(mp.pi / 2, 25, 25, 25),
        "LN2": parts(mp.log(2), 32),
        "PI": (float(mp.pi), float(mp.pi - mpf(float(mp.pi)))),
        "ARCTANGENTS": tuple(halves),
        "SINE": interpolated(sine, mpf(10) ** -30, quarter**2, 7),
        "COSINE": interpolated(cosine, mpf(10) ** -12, quarter**2, 7),
        "EXPONENTIAL": interpolated(exponential, -edge, edge, 12),
        "LOGARITHM": interpolated(logarithm, mpf(10) ** -30, s**2, 8),
        "ARCTANGENT": interpolated(arctangent, mpf(10) ** -30, mpf("0.0576"), 11),
    }


if __name__ == "__main__":
    for name, values in made().items():
        print(name, values)
