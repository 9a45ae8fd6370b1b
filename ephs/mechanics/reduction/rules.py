"""The rewrites that there are, in the order in which `ephs.reduce` does them."""

from ephs.mechanics.reduction.dropping import DROP_FRICTION, DROP_GYROSCOPIC, DROP_JOINT, DROP_POSE
from ephs.mechanics.reduction.folding import FOLD
from ephs.mechanics.reduction.merging import MERGE
from ephs.mechanics.reduction.rewrite import Rule

__all__ = ["RULES"]

RULES: tuple[Rule, ...] = (FOLD, DROP_FRICTION, MERGE, DROP_JOINT, DROP_GYROSCOPIC, DROP_POSE)
