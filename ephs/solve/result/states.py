"""States of a record by path, as users read them, each made when it is asked for."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import final

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.pairs import Pair
from ephs.semantics.systems.kept import once


@final
class RecordedStates(Mapping[Path, Array]):
    """Columns of states x (n, point_size) by path, in `coordinates`."""

    def __init__(self, descriptor: Descriptor, x: Array) -> None:
        self._slots, self.x = once(descriptor, "slots", lambda: {slot.path: slot for slot in descriptor.states}), x
        self._read: dict[Path, Array] = {}

    def __getitem__(self, path: Path) -> Array:
        found = self._read.get(path)
        if found is None:
            slot = self._slots[path]
            found = self._read[path] = coordinates(slot.quantity, self.x[:, slot.point])
        return found

    def __iter__(self) -> Iterator[Path]:
        return iter(self._slots)

    def __len__(self) -> int:
        return len(self._slots)


def coordinates(quantity: Quantity, x: Array) -> Array:
    """States (n, size) as users read them: scalars (n,), relative poses as the pair's coordinates (n, d)."""
    if quantity.kind == "relative_pose":
        pair = Pair.from_space(quantity.space)
        return x if pair.manifold.code == VECTOR else pair.coordinates(x)
    return x[:, 0] if x.shape[1] == 1 else x


def near_states(path: Path, known: list[Path]) -> str:
    """The states that a wrong path may mean, in words: those below it, those of like names, or all."""
    below = [str(each) for each in known if each[: len(path)] == path]
    near = get_close_matches(str(path), [str(each) for each in known], n=3, cutoff=0.7)
    if below:
        return f"below it lie {', '.join(below)}"
    return f"did you mean {' or '.join(near)}?" if near else f"the states are {', '.join(map(str, known))}"
