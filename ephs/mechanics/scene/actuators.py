"""Actuators: controls as forces on joints or tendons."""

from collections.abc import Mapping
from typing import Any, Self, final

import numpy as np

from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import AXIS
from ephs.mechanics.scene.gears import counted, different
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import Numbers, Range, Text
from ephs.mechanics.scene.site import Site


@final
class Actuator(Element, section="actuators", said="actuators: forces on joints by a control"):
    """A control as forces on joints, or on the length of a tendon: an input by name, for motors without dynamics."""

    joints: list[Text] = key("joints with one degree of freedom", [], names=AXIS)
    tendon: Text | None = key("instead of joints: a tendon, on whose length it acts", None, names="tendon")
    ratio: Numbers = key(
        'force on each by the control, the input "actuators.NAME"; {}', 1.0, unit="J/qᵢ", shown="N m, N"
    )
    limits: Range | None = key("least and largest control", None, unit="1")
    different = different
    counted = counted

    @property
    def counts(self) -> tuple[int, ...]:
        """Admissible numbers of ratios; a single ratio holds for all joints."""
        return 1, len(self.joints) or 1

    @rule(
        "joints", "tendon", at="", found="{found}", expected="either joints or a tendon", advice="give one of the two"
    )
    def aimed(self) -> Told:
        """Whether it acts on joints, or on a tendon."""
        return bool(self.joints) != (self.tendon is not None) or {"found": "both" if self.joints else "neither"}

    def normalised(self) -> Self:
        ratio = np.atleast_1d(self.ratio)
        return self.changed(ratio=np.repeat(ratio, len(self.joints) if self.joints and ratio.size == 1 else 1).tolist())

    @classmethod
    def _upgraded(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        return {key: value for key, value in table.items() if key != "heat"}

    def build(self, site: Site) -> None:
        """Nothing: runs have its forces as signals."""

    def __str__(self) -> str:
        return f"{self.tendon or ' – '.join(self.joints)}, {', '.join(f'{x:g}' for x in np.atleast_1d(self.ratio))}"
