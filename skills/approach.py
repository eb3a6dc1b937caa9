"""Bring the cup onto a target."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from executive.cell import Cell, LeastTimes, Steps, Via
from executive.geometry import Array
from executive.messages import Target
from executive.moving import follow, planned, settle, travel
from executive.skill import EMPTY, In, Metres, Skill, param, port

GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


class Approach(Skill):
    """Touch the target with the cup from above.

    Travels above it, comes down fast and feels its way through the last part, since the surface may be
    higher or lower than a camera can tell, but not below the target's middle: what is felt there is the
    table. Succeeds on contact near the expected height. Every attempt after a failed one comes down a
    little beside the last: on a spiral, or further round the ring of a part with a hole.
    """

    target: In[Target] = port(doc="where to go")
    overtravel: Metres = param(0.015, ge=0, le=0.03, doc="how far below the expected surface to feel")
    offset: Metres = param(0.0025, ge=0, le=0.02, doc="spacing of the spiral of further attempts")
    reasons: ClassVar = ("unreachable", "blocked", "no_contact")
    uses: ClassVar = ("arm", "tool")
    moves: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the time of the guarded part of the way down [s]; the arm may stand above the target."""
        del given
        return least.descent

    def run(self, cell: Cell) -> Steps:
        """Go above the place, then feel the way down."""
        yield from settle(cell.arm)
        kind = cell.classes[self.target.label]
        surface = float(self.target.position[2]) + kind.height / 2
        place = self.target.position[:2] + self._aside(cell, kind.ring)
        lowest = max(surface - self.overtravel, kind.height / 2)
        above = Via(np.array([*place, surface + cell.descent]))
        down = Via(np.array([*place, lowest]), speed=cell.descent_speed)
        yield from follow(cell.arm, planned(self, lambda: cell.arm.plan([*travel(cell, place), above])))
        descent = planned(self, lambda: cell.arm.plan([down]))
        yield from follow(cell.arm, descent, until=lambda: cell.tool.touching)
        height = float(cell.arm.tool_pose.position[2])
        if not cell.tool.touching:
            cell.ledger.missed(self.target.item)
            raise self.failed(
                "no_contact",
                f"nothing felt down to {height * 1000:.0f} mm, {self.target.item} was expected at "
                f"{surface * 1000:.0f} mm",
            )
        cell.ledger.touched(self.target.item)

    def _aside(self, cell: Cell, ring: float) -> Array:
        """Return the sideways step `(2,)` [m] of this attempt: a point of the ring, or of Vogel's spiral.

        The turn of a part is not known, and any point of its ring is as good as another. The spiral begins
        in the middle.
        """
        attempt = cell.ledger.attempts(self.target.item)
        angle = attempt * GOLDEN_ANGLE
        distance = ring or self.offset * math.sqrt(attempt)
        return distance * np.array([math.cos(angle), math.sin(angle)])
