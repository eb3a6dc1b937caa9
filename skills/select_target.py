"""Choose what to pick next."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from executive.cell import Cell, Steps
from executive.messages import Item, Target
from executive.skill import In, Out, Skill, param, port


class SelectTarget(Skill):
    """Know which target to pick next and where it belongs.

    Passes over targets that are rejected, done, of a class without a route, or put in doubt by what the
    robot did since they were seen.
    """

    targets: In[list[Target]] = port(doc="what the last look localized")
    same: In[Item | None] = port(default=None, refers="item", doc="only this item")
    wanted: In[str | None] = port(default=None, refers="class", doc="only this class")
    target: Out[Target] = port(doc="the chosen target")
    item: Out[Item] = port(refers="item", doc="the item it is bound to")
    bin: Out[str] = port(refers="bin", doc="the one of its class's bins with the fewest objects")
    prefer: str = param(
        "nearest", choices=("nearest", "surest"), doc="`nearest` to the tool, or the `surest` detection"
    )
    reasons: ClassVar = ("no_candidate", "unseen")

    def run(self, cell: Cell) -> Steps:
        """Filter, order, take the first."""
        yield from ()
        candidates = [target for target in self.targets if self._eligible(cell, target)]
        if not candidates:
            sought = self.same or self.wanted or "object to sort"
            if self.same is None and cell.ledger.believes_empty():
                raise self.failed("no_candidate", f"no {sought} is left on the table but what was rejected")
            raise self.failed("unseen", f"the last look shows no {sought} that can be trusted; look again")
        here = cell.arm.tool_pose.position[:2]
        if self.prefer == "nearest":
            best = min(candidates, key=lambda t: (float(np.linalg.norm(t.position[:2] - here)), t.item))
        else:
            best = min(candidates, key=lambda t: (-t.confidence, t.item))
        self.target, self.item = best, best.item
        # The number of a bin's next slot is the number of objects let go in it.
        self.bin = min(cell.routes[best.label], key=cell.ledger.objects_in)
        cell.decided(best, self.bin)

    def _eligible(self, cell: Cell, target: Target) -> bool:
        return (
            cell.ledger.is_open(target.item)
            and cell.ledger.is_fresh(target)
            and target.label in cell.routes
            and (self.same is None or target.item == self.same)
            and (self.wanted is None or target.label == self.wanted)
        )
