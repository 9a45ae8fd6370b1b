"""What is done first: a rule waits for the joints of its own body, and for no others."""

import numpy as np

from ephs import Pattern, junction, quantity
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.rewrite.dropping import DROP_FRICTION, DROP_GYROSCOPIC, DROP_POSE
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.rewrite import rewrite, sites_of

NAMES = ("left", "right", "alone", "other")


def pairs():
    """Two weightless bodies that are joined rigidly, and two others on a hinge, of which the first one is a brick."""
    momentum = quantity.body_momentum
    bodies = {name: rigid_body(1.0, [0.3, 0.4, 0.5], np.zeros(3)) for name in NAMES}
    return Pattern(
        junctions={f"p_{name}": junction(momentum) for name in NAMES},
        boxes={name: {"p": f"p_{name}"} for name in NAMES}
        | {"weld": {"p1": "p_left", "p2": "p_right"}, "hinge": {"p1": "p_alone", "p2": "p_other"}},
    )(**bodies, weld=joint("fixed"), hinge=joint("revolute"))


def test_rules_wait_for_a_weld_of_their_own_body():
    system = rewrite(pairs(), (FOLD, DROP_FRICTION)).system
    for rule in (DROP_GYROSCOPIC, DROP_POSE):
        found = {str(site.where).split(".")[0]: site.refusal for site in sites_of(system, rule)}
        assert set(found) == set(NAMES)
        for name, refusal in found.items():
            waits = refusal.startswith("weld") and refusal.endswith("comes first")
            assert waits == (name in ("left", "right")), (rule.name, name, refusal)
            assert "weld" not in refusal or waits
