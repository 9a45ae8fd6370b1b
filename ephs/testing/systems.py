"""Strategies for systems, and checks of their laws."""

from collections.abc import Mapping

from hypothesis import strategies as st
from hypothesis.errors import InvalidArgument

from ephs.operad import Interface, Nesting, Path, Quantity, Space, quantity
from ephs.semantics import Irreversible, Reference, Reversible, Storage, System
from ephs.semantics.primitives.primitives import state_ports
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.systems.laws import Probe, random_probe, system_law
from ephs.semantics.systems.system import Filling
from ephs.testing.levels import levels
from ephs.testing.primitives import irreversibles, reversibles, storages

SCALARS = (
    (quantity.displacement, quantity.momentum, quantity.entropy),
    (quantity.charge, quantity.flux_linkage, quantity.entropy),
    (quantity.volume, quantity.momentum, quantity.entropy),
    (quantity.flux_linkage, quantity.angular_momentum, quantity.entropy, quantity.charge),
)
GROUPS = (
    (quantity.pose, quantity.body_momentum, quantity.entropy),
    (quantity.direct_pose, quantity.direct_momentum, quantity.entropy),
    (quantity.relative_pose("spherical"), quantity.joint_momentum("spherical"), quantity.entropy),
    (quantity.joint_momentum("planar"), quantity.displacement, quantity.entropy),
)
STRETCH, PULL = Quantity("stretch", Space("real", 1, 1), 1), Quantity("pull", Space("real", 1, 1), -1)
OWN = ((STRETCH, PULL, quantity.entropy), (PULL, quantity.charge, quantity.entropy, STRETCH))
"""Quantities that have something to exchange: of either parity, and heat."""


@st.composite
def systems(
    draw: st.DrawFn,
    *,
    max_depth: int = 3,
    max_junctions: int = 3,
    isolated: bool | None = None,
    groups: bool = True,
    posed: bool = True,
) -> System:
    """Hierarchical systems that have a motion: each state has one storage, at any level.

    Among them are states that parts show to the levels around them or identify, at three ports too, that are read
    several levels away from their storage, and that have several balances of flows, which are links of the flat
    pattern; links of three junctions, states in a frame, outer power ports without power inside, chains of identities;
    components and quantities of one's own.

    Parameters
    ----------
    max_depth
        How many levels.
    max_junctions
        How many junctions a level adds.
    isolated
        Whether there are no outer ports; either where None.
    groups
        Whether states on Lie groups occur beside real ones.
    posed
        Whether each state has one storage; else some have two, or none, and there is no motion but a relation.

    Raises
    ------
    InvalidArgument
        A bound is less than 1.
    """
    for name, value in (("max_depth", max_depth), ("max_junctions", max_junctions)):
        if value < 1:
            raise InvalidArgument(f"{name}={value}: expected at least 1")
    pool = draw(st.sampled_from(SCALARS + OWN + (GROUPS if groups else ())))
    framed = draw(st.integers(0, 2))
    pool = (*(of.in_frame("B") for of in pool[:framed]), *pool[framed:])
    alone = draw(st.booleans()) if isolated is None else isolated
    count = 0 if alone else 1
    return draw(levels(depth=max_depth, most=max_junctions, pool=pool, ports={}, open_count=count, posed=posed))


@st.composite
def fillings(draw: st.DrawFn, nesting: Nesting) -> System:
    """Systems on a drawn nesting of patterns, well-posed or not: they have a relation, if not always a motion.

    States may be stored by several, by nobody, or outside only.
    """
    leaves: dict[Path, Storage | Reversible | Irreversible] = {}
    for box, content in nesting.top_down().boxes.items():
        interface = content.interface
        reads = state_ports(interface)
        if _storable(interface) and draw(st.sampled_from((False, True, True))):
            leaves[box] = draw(storages(interface))
        else:
            leaves[box] = draw(st.one_of(reversibles(interface, reads=reads), irreversibles(interface, reads=reads)))
    return _filled(nesting, leaves, Path())


def _storable(interface: Interface) -> bool:
    """Whether `storages` has one for it."""
    found = [port_type.quantity for port_type in interface.values()]
    vectors = all(manifold(each.space).code == codes.VECTOR and not each.environment for each in found)
    return all(port_type.power for port_type in interface.values()) and (
        len(found) == 1 or (len(found) > 1 and vectors)
    )


def _filled(nesting: Nesting, leaves: Mapping[Path, Filling], path: Path) -> System:
    inner = nesting.children
    parts: dict[Path, Filling] = {
        box: _filled(inner[box], leaves, path / box) if box in inner else leaves[path / box]
        for box in nesting.pattern.boxes
    }
    return System.of(nesting.pattern, parts)


def check_functoriality(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check the relation at a random state.

    Flattening before filling means the same as filling before composing, patterns and Dirac structures compose to
    Dirac structures, and names of boxes mean nothing.

    Raises
    ------
    AssertionError
        With the law that fails, and how far.
    """
    _check(random_probe(system, seed, reference=reference), "functoriality", "Tellegen", "Dirac", "renaming")


def check_power_balance(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check that over a step energy, exergy and volume change by what outer ports supply, less the destruction.

    Raises
    ------
    AssertionError
        With the law that fails, and how far.
    """
    _check(random_probe(system, seed, reference=reference), "power balance", "exergy balance", "conservation")


def check_natural(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check that a step of the nested system is the step of the flat one.

    Raises
    ------
    AssertionError
        With how far they are apart.
    """
    _check(random_probe(system, seed, reference=reference), "naturality")


def _check(probe: Probe, *names: str) -> None:
    for name in names:
        law = system_law(name)
        verdict = law(probe)
        if not verdict.holds:
            allowed = f"{verdict.detail}; allowed {verdict.tolerance:.1e}"
            raise AssertionError(f"{law.name}: {law.statement}\n{allowed}\n{probe.system}")
