"""Impacts: simultaneous coupled contacts form an island with one coefficient of restitution.

Moreau's law: with velocities γ before and γ⁺ = γ + G P after, ξ = γ⁺ + e γ and P are complementary in the friction
cones. With one coefficient the energy ½ Pᵀ(γ + γ⁺) that the impulses give is at most −½ (1 − e)/(1 + e) PᵀGP, so never
positive, for any number of contacts (Moreau, in *Nonsmooth Mechanics and Applications*, CISM 302 (1988), 1-82). Single
contacts of an island may give what others take: its heat is shared by those that lose energy, as they lose it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.shapes.impact import Impact
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index

TIED = 1e-12
"""Least coupling of two contacts, relative to the largest mobility."""
GAINED = 1e-11
"""Largest relative energy gain of an impact that counts as rounding."""


@final
class Unlawful(Exception):
    """An impact that has no impulses, or would gain energy: one of its contacts, and why."""

    def __init__(self, contact: int, reason: str) -> None:
        super().__init__(contact, reason)
        self.contact, self.reason = contact, reason


@final
@dataclass(frozen=True, slots=True, eq=False)
class Blow:
    """Impulses (3m,) of contacts, and the kinetic energy (m,) in J that becomes heat at each."""

    impulse: Array
    heat: Array


def islands_of(mobility: Array) -> Iterator[Index]:
    """Contacts that act on each other, by the mobility G (3m, 3m)."""
    m = len(mobility) // 3
    size = np.abs(mobility).reshape(m, 3, m, 3).max(axis=(1, 3)) if m else np.zeros((0, 0))
    own = np.sqrt(np.diag(size))
    tied = size > TIED * np.outer(own, own)
    left = set(range(m))
    while left:
        island, fresh = set[int](), {min(left)}
        while fresh:
            island |= fresh
            fresh = {int(j) for i in fresh for j in np.flatnonzero(tied[i])} - island
        left -= island
        yield np.array(sorted(island), dtype=np.int64)


def shared(taken: Array) -> Array:
    """Heat of each contact of an island: its share of the lost kinetic energy, of either sign."""
    losing = np.maximum(taken, 0.0)
    whole, total = float(losing.sum()), max(float(taken.sum()), 0.0)
    return losing * (total / whole if whole > 0.0 else 0.0)


def struck(mobility: Array, before: Array, laws: Sequence[Impact], touching: float, quiet: Array) -> Blow:
    """The impact at one instant.

    Parameters
    ----------
    mobility, before
        G (3m, 3m), and velocities γ (3m,) before it.
    touching, quiet
        Speeds in m/s below which a contact does not approach, and (m,) below which it does not bounce: an island
        bounces where one of its contacts does.

    Raises
    ------
    Unlawful
        It has no impulses, or gains energy.
    """
    m = len(laws)
    impulse, heat = np.zeros(3 * m), np.zeros(m)
    for island in islands_of(mobility):
        speed = -before[3 * island]
        if speed.max() <= touching:
            continue
        own = [laws[i] for i in island]
        bouncing = bool(np.any(speed > quiet[island]))
        restitution = min(law.restitution for law in own) if bouncing else 0.0
        slipping = min(law.slip_restitution for law in own) if bouncing else 0.0
        at = (3 * island[:, None] + np.arange(3)).ravel()
        whole, first = mobility[np.ix_(at, at)], before[at]
        free = first * (1.0 + np.tile([restitution, slipping, slipping], len(own)))
        found = impulses(whole, free, [law.friction for law in own])
        if found is None:
            raise Unlawful(int(island[0]), "impulses in the cones of its contacts were not found")
        taken = -0.5 * (found * (2.0 * first + whole @ found)).reshape(-1, 3).sum(axis=1)
        if taken.sum() < -GAINED * float(np.abs(found * first).sum()):
            reason = f"the impact would gain {-taken.sum():.3g} J; with one coefficient for both none does"
            raise Unlawful(int(island[0]), reason)
        impulse[at], heat[island] = found, shared(taken)
    return Blow(impulse, heat)
