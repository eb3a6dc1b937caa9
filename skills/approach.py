"""Bring the cup onto a target."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from executive.arm import Goal, Task
from executive.cell import Cell, LeastTimes, Steps, Tool
from executive.evidence import describe_wrong_height, may_miss_top
from executive.goals import OVERTRAVEL, SPACING, approach
from executive.messages import Target
from executive.moving import follow, planned
from executive.skill import EMPTY, In, Metres, Skill, param, port

EARLY = 0.001
"""How far above the part in which contact is expected it means that something is in the way [m]."""


class Approach(Skill):
    """Touch the target with the cup from above.

    One motion: over the target and down, fast, then feeling its way through the last part, since the surface
    may be higher or lower than a camera can tell. Succeeds on contact near the expected height. Every attempt
    after a failed one comes down a little beside the last: on a spiral, or further round the ring of a part
    with a hole. A touch at a height that the target's class does not have is a contradiction;
    a lower touch at the height of no class is one if it is the second, or if looks do not prove the class.
    """

    target: In[Target] = port(doc="where to go")
    overtravel: Metres = param(OVERTRAVEL, ge=0, le=0.03, doc="how far below the expected surface to feel")
    offset: Metres = param(SPACING, ge=0, le=0.02, doc="spacing of the spiral of further attempts")
    reasons: ClassVar = ("stale", "unreachable", "blocked", "contradicted", "no_contact")
    uses: ClassVar = ("arm", "tool")
    moves: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the time of the guarded part of the way down [s]; the arm may stand above the target."""
        del given
        return least.descent

    def run(self, cell: Cell) -> Steps:
        """Go there, down to the touch."""
        item, tool = self.target.item, cell.tool
        if not cell.ledger.is_fresh(self.target):
            seen = f"{item} was seen at {self.target.stamp:.2f} s"
            raise self.failed("stale", f"{seen}, and what happened since may have moved it; look again")

        def ask() -> tuple[Goal, Task]:
            return approach(cell, self.target, self.overtravel, self.offset)

        motion = yield from planned(self, cell.arm, ask)
        goal, _ = ask()
        yield from follow(self, cell, motion, until=_landing(tool))
        height, highest = float(cell.arm.tool_pose.position[2]), goal.position[2] + goal.guarded
        expected = f"expected at {(highest - cell.descent) * 1000:.0f} mm"
        if not tool.touching:
            cell.ledger.missed(item)
            felt = f"nothing felt down to {height * 1000:.0f} mm"
            raise self.failed("no_contact", f"{felt}, {item} was {expected}")
        if height > highest + EARLY:
            cell.ledger.bumped()
            met = f"the tool met something at {height * 1000:.0f} mm"
            raise self.failed("blocked", f"{met}, on its way to {item}, which was {expected}")
        doubt = describe_wrong_height(self.target.label, height, cell.classes)
        beside_top = may_miss_top(self.target.label, height, cell.classes)
        if not cell.ledger.touched(item, doubt, beside_top=beside_top):
            raise self.failed("contradicted", f"{item} may be no {self.target.label}: {doubt}")


def _landing(tool: Tool) -> Callable[[], bool]:
    """Return what tells whether the tool touches something, once it has left what it touches now."""
    away = not tool.touching

    def landed() -> bool:
        nonlocal away
        touching = tool.touching
        away = away or not touching
        return away and touching

    return landed
