"""Skill that opens the tool unless sensor and ledger agree that the tool holds an item."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import ANY, EMPTY, HOLDING, Out, Skill, port


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
        """Compare sensor and ledger; unless both report an item, open the tool and fail."""
        item = cell.ledger.find_held_item()
        noun = cell.tool_model.noun
        is_holding = cell.tool.holding
        if is_holding and item is not None:
            self.held = item
            return
        cell.tool.open()
        if item is not None:
            cell.ledger.record_drop(item)
            raise self.failure("empty", f"the sensor detects no {noun}; {item} was dropped")
        if not is_holding:
            raise self.failure("empty", f"the sensor detects no {noun}")
        cell.ledger.invalidate_positions()
        message = f"the sensor detects a {noun}, but the ledger knows no held item; the tool was opened"
        raise self.failure("empty", message)
