"""A pose that was dropped is found again across a joint, from either side, with frames that are turned and moved."""

import numpy as np
import pytest

from ephs import Path
from ephs.mechanics import joint, mbs_pattern, rigid_body
from ephs.mechanics.rewrite.dropping import DROP_FRICTION, DROP_POSE
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.rewrite import rewrite
from ephs.semantics.spaces import SE3
from tests.numerics import largest


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_pose_follows_from_the_other_one_and_the_joint(seed, turned):
    rng = np.random.default_rng(seed)
    near, far, pose = SE3.random(rng), SE3.random(rng), SE3.random(rng)
    bodies = {f"body{i}": rigid_body(float(i), [0.3, 0.4, 0.5], np.zeros(3)) for i in (1, 2)}
    pattern = mbs_pattern()
    if turned:  # the pose that is kept is at the joint's second frame
        pattern = type(pattern)(
            junctions={str(path): junction for path, junction in pattern.junctions.items()},
            boxes={"body1": {"p": "p1"}, "body2": {"p": "p2"}, "joint": {"p1": "p2", "p2": "p1"}},
        )
    system = pattern(joint=joint("spherical", near, far), **bodies)
    before = rewrite(system, (FOLD, DROP_FRICTION)).system
    done = rewrite(before, (DROP_POSE,))
    assert len(done.done) == 1
    element = SE3.exp(np.concatenate([rng.standard_normal(3), np.zeros(3)]))
    other = SE3.compose(SE3.compose(SE3.compose(pose, near), element), SE3.inverse(far))
    first, second = (other, pose) if turned else (pose, other)
    state = {Path.of("body1.pe.q"): first, Path.of("body2.pe.q"): second}
    for path in before.states:
        if path not in state:
            state[path] = element[:4] if path[-1] == "q_r" else rng.standard_normal(6)
    kept = done.states.forward(state)
    assert set(kept) == set(done.system.states) and len(kept) == len(state) - 1
    found = done.states.back(kept, state)
    for path, value in state.items():
        assert largest(found[path] - value) <= 1e-12, path
