"""Interface of the attached network and a mechanism: degrees of freedom, states that components read, entropies
made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.tree.finding.frames import Unplaced
from ephs.mechanics.tree.finding.network import Network
from ephs.mechanics.tree.finding.parts import Parts
from ephs.mechanics.tree.finding.spanning import Edge
from ephs.mechanics.tree.finding.tables import MechanismTables
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.descriptor import ComponentSlot
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.equations.sparse import Index


@final
@dataclass(frozen=True, slots=True)
class RateRelation:
    """A constant relation Σ ratio · rate = 0, by the component that has it: (edge, degree of freedom, ratio) of its
    joints.
    """

    path: Path
    terms: tuple[tuple[int, int, float], ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Attaching:
    """Where a network is attached to a mechanism.

    Parameters
    ----------
    ports
        (rates,) degrees of freedom of joints.
    reads, varies
        Of each component that is called: places in s of the states that it reads, −1 − place of a joint's element; and
        of what changes them, −1 − degree of freedom of a joint.
    flows
        Of each component that is called: the places of the entropies that its ports make.
    bent
        Degrees of freedom of the joints that are read.
    edges
        First degrees of freedom of the joints at which something is attached.
    outer
        (states,) energy of the environment by a state in it, as −π₀ of a volume; 0 of others.
    ties
        Constant relations of rates of joints.
    """

    network: Network
    ports: Index
    reads: tuple[Index, ...]
    varies: tuple[Index, ...]
    flows: tuple[Index, ...]
    bent: Index
    edges: frozenset[int]
    outer: Array
    ties: tuple[RateRelation, ...]


def makers_of(components: Sequence[ComponentSlot], network: Network) -> tuple[tuple[Path, ...], tuple[Index, ...]]:
    """Components that make entropy, one place each, and a further one for each further port of what is called.

    Returns
    -------
    made, flows
        Path of each place; of each component that is called, the places of its ports of entropy.
    """
    made = [slot.path for slot in components if isinstance(slot.primitive, Irreversible)]
    first = {path: i for i, path in enumerate(made)}
    flows: list[Index] = []
    for one in network.attached:
        path, more = components[one.component].path, len(one.heated)
        places = [first[path], *range(len(made), len(made) + more - 1)][:more] if more else []
        flows.append(np.array(places, dtype=np.int64))
        made += [path] * (more - 1)
    return tuple(made), tuple(flows)


def attaching_of(
    components: Sequence[ComponentSlot],
    parts: Parts,
    joints: Sequence[Edge],
    tables: MechanismTables,
    stored: Sequence[Path],
    flows: tuple[Index, ...],
    reference: Reference,
) -> Attaching:
    """A system's network at its mechanism.

    Raises
    ------
    Unplaced
        A component reads states that have no place.
    """
    network = parts.network
    at = {id(edge): first for edge, first in zip(joints, tables.r_at.tolist(), strict=False)}
    known = {path: ([k], [k]) for k, path in enumerate(stored)}
    for i, edge in enumerate(joints):
        if edge.path is not None and edge.state is not None:
            q, r = int(tables.q_at[i]), int(tables.r_at[i])
            known[edge.state] = (
                [-1 - place for place in range(q, q + edge.pair.size)],
                [-1 - freedom for freedom in range(r, r + edge.pair.dim)],
            )
    reads, varies = list[Index](), list[Index]()
    for one in network.attached:
        for path in one.reads:
            if path not in known:
                raise Unplaced(components[one.component].path, f"reads {path}, which is neither attached nor a joint's")
        for k, out in enumerate((reads, varies)):
            out.append(np.array([place for path in one.reads for place in known[path][k]], dtype=np.int64))
    number = {id(edge): i for i, edge in enumerate(joints)}
    ties: list[RateRelation] = []
    for tie in network.ties:
        terms = [(*network.rates[place], ratio) for place, ratio in tie.terms]
        path = components[tie.component].path
        if any(parts.attached[junction].pair.code != VECTOR for junction, _, _ in terms):
            raise Unplaced(path, "ties the rate of a joint whose degrees of freedom do not commute")
        ties.append(RateRelation(path, tuple((number[id(parts.attached[at])], k, ratio) for at, k, ratio in terms)))
    bent = sorted({-1 - int(place) for places in varies for place in places if place < 0})
    return Attaching(
        network,
        np.array([at[id(parts.attached[junction])] + k for junction, k in network.rates], dtype=np.int64),
        tuple(reads),
        tuple(varies),
        flows,
        np.array(bent, dtype=np.int64),
        frozenset(at[id(edge)] for edge in parts.attached.values()),
        _outer(components, network, reference),
        tuple(ties),
    )


def _outer(components: Sequence[ComponentSlot], network: Network, reference: Reference) -> Array:
    """(states,) energy of the environment by its states."""
    out = np.zeros(len(network.states))
    for component, first in network.storages:
        primitive = components[component].primitive
        if isinstance(primitive, Storage) and primitive.environment:
            here = [float(reference.intensive(of)[0]) for _, _, of in primitive.bundle.items()]
            out[first : first + len(here)] = here
    return out
