"""Skills that close the tool on an object, and confirm that the tool holds it."""

from __future__ import annotations

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.skill import ANY, EMPTY, HOLDING, In, Out, Seconds, Skill, param, port


class Grasp(Skill):
    """Close the tool on the target and verify the grasp.

    The skill succeeds if the tool's sensor reports a seal after the settling time `settle`.
    """

    target: In[Target] = port(doc="the target that the tool touches")
    held: Out[Item] = port(refers_to="item", doc="the item in the tool")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time to wait before reading the sensor")
    reasons = ("missed",)
    uses = ("tool",)
    tool_state = (EMPTY, HOLDING)
    waits = "settle"

    def run(self, cell: Cell) -> Steps:
        """Close the tool, wait, and read the vacuum sensor."""
        cell.tool.close()
        is_sealed = False
        try:
            yield from cell.clock.sleep(self.settle)
            is_sealed = cell.tool.holding
        finally:
            # A halted skill must not leave an object in the tool, because the ledger has recorded no grasp.
            if not is_sealed:
                cell.tool.open()
        if not is_sealed:
            cell.ledger.record_failed_pick(self.target.item)
            raise self.failure("missed", f"no seal on {self.target.item} {self.settle:.2f} s after contact")
        cell.ledger.record_grasp(self.target.item)
        self.held = self.target.item


class ConfirmGrasp(Skill):
    """Confirm with the sensor of the tool that the tool holds an item; otherwise open the tool and fail.

    The sensor and the ledger must both report an item. If only the ledger reports an item, the skill also
    records a drop. After an interrupted transit, a mission can thus decide how to continue. To check without
    side effects, use the condition `IsHolding`.
    """

    held: Out[Item] = port(refers_to="item", doc="the item in the tool")
    reasons = ("empty",)
    uses = ("tool",)
    senses = True
    tool_state = (ANY, HOLDING)
    tool_state_after_failure = {"empty": EMPTY}

    def run(self, cell: Cell) -> None:
        """Compare the vacuum sensor with the ledger; unless both report an item, open the tool and fail."""
        item = cell.ledger.find_held_item()
        is_sealed = cell.tool.holding
        if is_sealed and item is not None:
            self.held = item
            return
        cell.tool.open()
        if item is not None:
            cell.ledger.record_drop(item)
            raise self.failure("empty", f"the sensor detects no seal; {item} was dropped")
        if is_sealed:
            cell.ledger.invalidate_positions()
        seal = "a seal, but the ledger knows no held item; the tool was opened" if is_sealed else "no seal"
        raise self.failure("empty", f"the sensor detects {seal}")
