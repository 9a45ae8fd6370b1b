"""What a run of the benchmarks says beside an earlier one: which cases got slower, whatever the machine's speed.

Nothing here measures time.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, final

__all__ = ["EVERYTHING", "Timing", "Verdict", "compare", "in_both", "timing"]

SLOWER = 1.15
"""A case that takes this many times what it took, relative to all others, got slower."""
EVERYTHING = "all of ephs, beside what is not ephs"


@final
@dataclass(frozen=True, slots=True)
class Timing:
    """How long a case takes.

    Parameters
    ----------
    seconds
        The least that was measured.
    spread
        By what part of that the middle one of the processes' best is more.
    """

    seconds: float
    spread: float


def timing(processes: Sequence[Sequence[float]]) -> Timing:
    """The timing of a case from the seconds that each process measured."""
    best = sorted(min(seconds) for seconds in processes)
    return Timing(best[0], median(best) / best[0] - 1.0)


@final
@dataclass(frozen=True, slots=True)
class Verdict:
    """What changed between two runs.

    Parameters
    ----------
    speed
        The median of the ratios of seconds, now to then: the machine's, and what all of the package has in common.
    ratios
        Case -> ratio of its seconds, over ``speed``.
    slower, faster
        Cases that changed by more than `SLOWER` and their spread.
    unsure
        Cases slower than `SLOWER`, but not by more than their spread.
    new, missing
        Cases that only one of the runs has.
    """

    speed: float
    ratios: Mapping[str, float]
    slower: tuple[str, ...]
    unsure: tuple[str, ...]
    faster: tuple[str, ...]
    new: tuple[str, ...]
    missing: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that can be written as JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """One line for each thing that has to be said."""
        lines = [f"the run took {self.speed:.2f} times what the baseline took (median of {len(self.ratios)} cases)"]
        for word, names in (("SLOWER", self.slower), ("slower? too noisy", self.unsure), ("faster", self.faster)):
            lines += [f"{word}: {name}, {self.ratios[name]:.2f} times" for name in names]
        lines += [f"new, not in the baseline: {name}" for name in self.new]
        lines += [f"in the baseline, not measured: {name}" for name in self.missing]
        return "\n".join(lines if self.slower else [*lines, "nothing got slower"])


def compare(
    now: Mapping[str, Timing], then: Mapping[str, Timing], others: Collection[str] = (), among: Iterable[str] = ()
) -> Verdict:
    """Hold a run against an earlier one.

    Parameters
    ----------
    others
        Cases that measure what is not this package: they are not judged, but all cases of the package together are,
        against them, as the case `EVERYTHING`.
    among
        Cases whose median is the speed, all of the package unless given. It should not hold what is in doubt.
    """
    both = {name: now[name].seconds / then[name].seconds for name in now if name in then}
    own = [name for name in both if name not in others]
    measure = [name for name in among if name in own] or own
    speed = median(both[name] for name in measure) if measure else 1.0
    ratios = {name: both[name] / speed for name in own}
    noise = {name: now[name].spread + then[name].spread for name in own}
    outside = [name for name in both if name in others]
    if outside and measure:
        ratios[EVERYTHING] = speed / median(both[name] for name in outside)
        noise[EVERYTHING] = median(now[name].spread + then[name].spread for name in [*outside, *measure])

    def sorted_by_ratio(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(sorted(names, key=lambda name: -ratios[name]))

    above = [name for name, ratio in ratios.items() if ratio > SLOWER]
    return Verdict(
        speed,
        ratios,
        slower=sorted_by_ratio(name for name in above if ratios[name] > SLOWER * (1.0 + noise[name])),
        unsure=sorted_by_ratio(name for name in above if ratios[name] <= SLOWER * (1.0 + noise[name])),
        faster=sorted_by_ratio(name for name, ratio in ratios.items() if ratio * SLOWER * (1.0 + noise[name]) < 1.0),
        new=tuple(sorted(set(now) - set(then))),
        missing=tuple(sorted(set(then) - set(now))),
    )


def in_both(first: Verdict, second: Verdict) -> Verdict:
    """The first verdict, with only those cases slower that the second, of a part of the cases, finds slower again."""
    ratios = {name: min(ratio, second.ratios.get(name, ratio)) for name, ratio in first.ratios.items()}
    slower = tuple(name for name in first.slower if name in second.slower)
    doubtful = [name for name in (*first.slower, *first.unsure) if name not in slower and ratios[name] > SLOWER]
    return Verdict(first.speed, ratios, slower, tuple(doubtful), first.faster, first.new, first.missing)
