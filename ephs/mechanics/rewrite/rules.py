"""All rewrites, in the order of `ephs.reduce`."""

from ephs.mechanics.rewrite.dropping import DROP_FRICTION, DROP_GYROSCOPIC, DROP_JOINT, DROP_POSE
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.merging import MERGE
from ephs.mechanics.rewrite.rewrite import Rule

RULES: tuple[Rule, ...] = (FOLD, DROP_FRICTION, MERGE, DROP_JOINT, DROP_GYROSCOPIC, DROP_POSE)
