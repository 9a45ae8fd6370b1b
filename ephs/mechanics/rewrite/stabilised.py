"""A system with its joints stabilised: constraints on velocities and positions, with a multiplier for each."""

from ephs.mechanics.elements.closing import Q1, Q2, Q_R, closing
from ephs.mechanics.elements.components import holonomic
from ephs.mechanics.rewrite.frames import CONSTRAINED, bodies, inertia_at, joint_at
from ephs.mechanics.rewrite.rewrite import SystemDraft
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.systems.system import System

NAME = "stabilised"


def stabilised(system: System) -> System:
    """The flattened system with joints as velocity constraints, each with a box ``closing`` for its positions.

    In continuous time nothing changes: the second multipliers are zero. For comparison with the literature on
    stabilised index 2; ``natural`` keeps positions without it. Only the method ``natural`` solves it.

    Raises
    ------
    AssemblyError
        A joint between frames that have no pose or no inertia, as inside universal joints; it names the joint.
    """
    draft = SystemDraft(system)
    found = bodies(draft)
    for box in [box for box, part in draft.fillings.items() if part.name == CONSTRAINED]:
        joint = joint_at(draft, box)
        if joint is None:
            raise AssemblyError("rewrite", box, rule=NAME, found="its ends are no frames at constant offsets")
        weighed: list[tuple[Array, Array] | None] = []
        ports: dict[Path, Path] = {Q_R: draft.wires[box][Q_R].junction}
        for port, end, offset in zip((Q1, Q2), joint.ends, joint.offsets, strict=True):
            if end is None:
                weighed.append(None)
                continue
            body, inertia = found.get(end), inertia_at(draft, end)
            if body is None or inertia is None:
                raise AssemblyError("rewrite", box, rule=NAME, found=f"{end} is no body with inertia and pose")
            weighed.append((offset, inertia))
            ports[port] = body.pose
        draft.replace(box, holonomic(joint.pair, on_group=False), {})
        draft.add(Path((*tuple(box)[:-1], "closing")), closing(joint.pair, *weighed), ports)
    return draft.system()
