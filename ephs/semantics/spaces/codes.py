"""Codes of groups in compiled kernels.

A code names the *intrinsic* group, that is, how a point is stored and multiplied:

====== ============ ==== ==== ==========================================
code   group        dim  size a point is stored as
====== ============ ==== ==== ==========================================
VECTOR ℝᵈ           d    d    its coordinates
SO3    SO(3)        3    4    unit quaternion, scalar first
SE2    SE(2)~       3    3    angle (not wrapped), x, y
SE3    SE(3)        6    7    unit quaternion, position
SO3xR3 SO(3) × ℝ³   6    7    unit quaternion, position
====== ============ ==== ==== ==========================================
"""

from typing import Final

VECTOR: Final = 0
SO3: Final = 1
SE2: Final = 2
SE3: Final = 3
SO3xR3: Final = 4
