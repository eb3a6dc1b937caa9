"""Condition that the tool holds an item."""

from __future__ import annotations

from executive.cell.protocols import Cell
from executive.skill import ANY, HOLDING, Skill


class IsHolding(Skill):
    """Succeed if the sensor of the tool and the ledger both report an item in the tool.

    The condition changes nothing: after a failure, the ledger may still report a lost item, and the tool may
    still hold an unknown object. `ConfirmGrasp` corrects both.
    """

    is_condition = True
    reasons = ("empty",)
    senses = True
    tool_state = (ANY, HOLDING)
    tool_state_after_failure = {"empty": ANY}

    def run(self, cell: Cell) -> None:
        """Compare the vacuum sensor with the ledger."""
        item, is_sealed = cell.ledger.find_held_item(), cell.tool.holding
        if not is_sealed:
            known = f", but the ledger reports {item} in the tool" if item else ""
            raise self.failure("empty", f"the sensor detects no seal{known}")
        if item is None:
            raise self.failure("empty", "the sensor detects a seal, but the ledger knows no held item")
