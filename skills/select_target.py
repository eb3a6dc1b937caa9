"""Skill that selects the next target and its bin."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell
from executive.manipulation.obstacles import predict_object_count
from executive.manipulation.tool_goals import sort_pickable_targets
from executive.perception.evidence import describe_unknown_labels
from executive.skill import In, Out, Skill, SkillFailed, param, port


class SelectTarget(Skill):
    """Select the next target to pick, and its bin.

    The skill selects only open items with a valid position and a class with a route. Enough looks must agree
    on the class of an item, given the error rates of the detector. `nearest` refers to the tool or, while the
    arm moves, to the destination of the arm; `surest` refers to the confidence of the last detection.
    """

    targets: In[list[Target]] = port(doc="the known targets")
    same: In[Item | None] = port(default=None, refers_to="item", doc="only this item")
    wanted: In[str | None] = port(default=None, refers_to="class", doc="only this class")
    target: Out[Target] = port(doc="the chosen target")
    item: Out[Item] = port(refers_to="item", doc="the item of the target")
    bin: Out[str] = port(refers_to="bin", doc="the bin with the fewest used slots, of the bins of the class")
    prefer: str = param("nearest", choices=("nearest", "surest"), doc="the `nearest` or the `surest` target")
    reasons: ClassVar = ("no_candidate", "unseen", "doubtful")

    def run(self, cell: Cell) -> None:
        """Select the first candidate in the preferred order."""
        pickable_targets = sort_pickable_targets(cell, self.targets)
        candidates = [target for target in pickable_targets if self._is_requested(cell, target.item)]
        if not candidates:
            raise self._explain_missing_candidate(cell)
        best = candidates[0]
        if self.prefer == "surest":
            best = min(candidates, key=lambda target: (-target.confidence, target.item))
        self.target, self.item = best, best.item
        bins = cell.routes[cell.ledger.get_label(best.item)]
        self.bin = min(bins, key=lambda bin: predict_object_count(cell, bin))
        cell.report_selection(best, self.bin)

    def _is_requested(self, cell: Cell, item: Item) -> bool:
        label = cell.ledger.get_label(item)
        return label in cell.routes and self.same in (None, item) and self.wanted in (None, label)

    def _explain_missing_candidate(self, cell: Cell) -> SkillFailed:
        """Return the failure with the reason why there is no candidate."""
        items = cell.ledger.find_uncertain_items()
        if uncertain_items := ", ".join(item for item in items if self._is_requested(cell, item)):
            return self.failure("doubtful", f"not enough looks agree on {uncertain_items} yet; look again")
        name = self.same or self.wanted or "object to sort"
        if self.same is None and cell.ledger.is_table_empty(self.wanted):
            message = f"no {name} is left on the table, except rejected objects"
            unknown_labels = describe_unknown_labels(cell.ledger.unknown_labels)
            return self.failure("no_candidate", "; ".join(filter(None, (message, unknown_labels))))
        return self.failure("unseen", f"no {name} is in sight, but it is not certain that the table is empty")
