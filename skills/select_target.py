"""Choose what to pick next."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell
from executive.manipulation.obstacles import slots_taken
from executive.manipulation.tool_goals import nearest_first
from executive.perception.evidence import describe_unknown
from executive.skill import In, Out, Skill, SkillFailed, param, port


class SelectTarget(Skill):
    """Know which target to pick next and where it belongs.

    Passes over targets that are rejected, done, of a class without a route, put in doubt by what the
    robot did since they were seen, or seen by too few looks for as good as the detector is. While the arm
    moves, the choice is the one that it would be when it stands still again.
    """

    targets: In[list[Target]] = port(doc="where things are, as far as is known")
    same: In[Item | None] = port(default=None, refers="item", doc="only this item")
    wanted: In[str | None] = port(default=None, refers="class", doc="only this class")
    target: Out[Target] = port(doc="the chosen target")
    item: Out[Item] = port(refers="item", doc="the item it is bound to")
    bin: Out[str] = port(refers="bin", doc="the one of its class's bins with the fewest objects")
    prefer: str = param(
        "nearest", choices=("nearest", "surest"), doc="`nearest` to the tool, or the `surest` detection"
    )
    reasons: ClassVar = ("no_candidate", "unseen", "doubtful")

    def run(self, cell: Cell) -> None:
        """Filter, order, take the first."""
        candidates = [
            target for target in nearest_first(cell, self.targets) if self._is_sought(cell, target.item)
        ]
        if not candidates:
            raise self._none(cell)
        best = candidates[0]
        if self.prefer == "surest":
            best = min(candidates, key=lambda t: (-t.confidence, t.item))
        self.target, self.item = best, best.item
        bins = cell.routes[cell.ledger.get_label(best.item)]
        self.bin = min(bins, key=lambda bin: slots_taken(cell, bin))
        cell.decided(best, self.bin)

    def _is_sought(self, cell: Cell, item: Item) -> bool:
        label = cell.ledger.get_label(item)
        return (
            label in cell.routes
            and (self.same is None or item == self.same)
            and (self.wanted is None or label == self.wanted)
        )

    def _none(self, cell: Cell) -> SkillFailed:
        """Return why there is nothing to choose."""
        doubtful = [item for item in cell.ledger.find_uncertain_items() if self._is_sought(cell, item)]
        if doubtful:
            names = ", ".join(doubtful)
            return self.failed("doubtful", f"not enough looks agree on {names} yet; look again")
        sought = self.same or self.wanted or "object to sort"
        if self.same is None and cell.ledger.is_table_empty(self.wanted):
            left = f"no {sought} is left on the table but what was rejected"
            message = "; ".join(filter(None, (left, describe_unknown(cell.ledger.unknown))))
            return self.failed("no_candidate", message)
        return self.failed("unseen", f"no {sought} is in sight, and the table is not known to be empty")
