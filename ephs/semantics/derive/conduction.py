"""Flows of entropy between temperatures, by the differences of these."""

from collections.abc import Sequence

from ephs.semantics.stage.numbers import Real


def conducted(row: Sequence[Real], warmth: Sequence[Real], i: int) -> Real:
    """Flow of entropy at a place among others of given temperatures: Σ Mᵢⱼ (θⱼ − θᵢ)/θᵢ.

    That is Σ Mᵢⱼ (θⱼ − θ₀)/θ₀, as Σ Mᵢⱼ θⱼ = 0, without the difference of large numbers which that is between nearly
    equal temperatures: what such flows produce is a square of what these differ by.
    """
    total: Real = 0.0
    for j, (weight, theta) in enumerate(zip(row, warmth, strict=True)):
        if j != i:
            total = total + weight * (theta - warmth[i])
    return total / warmth[i]
