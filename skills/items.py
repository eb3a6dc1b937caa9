"""Skills that read or change the items of the ledger: list, defer and reject items."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.manipulation.grasps import explain_blocked_grasp
from executive.skill import In, Out, Skill, param, port

MIN_DROPS_OF_HEAVY_OBJECT = 3
"""Number of drops from which the report calls an object too heavy or slippery."""


class ListItems(Skill):
    """List the known items in a state, in the order of their first detection; the list may be empty.

    `open` items still have to be sorted; `deferred` items are open, too. `skipped` items have no route or
    exceed a quota, and `lost` items were dropped by the tool and not found since.
    """

    items: Out[list[Item]] = port(refers_to="item", doc="the items in this state")
    state: str = param(
        "open",
        choices=("open", "deferred", "placed", "rejected", "skipped", "lost"),
        doc="the state of the items",
    )
    class_: str = param("", refers_to="class", doc="only items of this class; empty: of all classes")
    bin: str = param("", refers_to="bin", doc="only items in this bin; empty: items anywhere")

    def run(self, cell: Cell) -> None:
        """Read the items from the ledger."""
        self.items = [
            known.item
            for known in cell.ledger.list_known_items()
            if (known.is_open if self.state == "open" else known.state == self.state)
            and self.class_ in ("", known.label)
            and self.bin in ("", known.bin)
        ]


class Defer(Skill):
    """Defer an item: `SelectTarget` selects the item only after every other candidate.

    The item stays open. Deferred items are selected in the order of their deferral. The skill fails with
    `exhausted` if the item was already deferred as often as `times` permits. An item in the tool or in a bin
    keeps its state; the deferral has an effect if the item returns to the table.
    """

    item: In[Item] = port(refers_to="item", doc="the item to defer")
    times: int = param(1, ge=1, doc="maximum number of times that the mission defers one item")
    reasons = ("exhausted",)

    def run(self, cell: Cell) -> None:
        """Defer the item in the ledger."""
        count = cell.ledger.describe(self.item).deferrals
        if count >= self.times:
            raise self.failure("exhausted", f"{self.item} was already deferred {count} times")
        cell.ledger.defer(self.item)


class EmptyBin(Skill):
    """Declare that a person or a conveyor has emptied a bin.

    The items stay placed, but no longer count as objects in the bin: its quotas and slots start again. In a
    simulated or fake cell, the objects disappear. The arm does not move.
    """

    bin: In[str] = port(refers_to="bin", doc="the emptied bin")

    def run(self, cell: Cell) -> None:
        """Declare the bin as emptied."""
        cell.empty_bins([self.bin])


class RejectTarget(Skill):
    """Reject an item: the robot leaves the item at its position, and the report lists it.

    Before the item has `after` failed attempts, the skill succeeds without an effect.
    """

    item: In[Item] = port(refers_to="item", doc="the item to reject")
    why: str = param("could not be picked", doc="reason in the report")
    after: int = param(0, ge=0, doc="minimum number of failed attempts before the rejection")

    def run(self, cell: Cell) -> None:
        """Reject the item in the ledger."""
        known = cell.ledger.describe(self.item)
        if known.attempts < self.after:
            return
        reason = f"{self.why} ({known.attempts} failed attempts)" if known.attempts else self.why
        targets = {target.item: target for target in cell.ledger.find_targets()}
        if self.item in targets and (blocker := explain_blocked_grasp(cell, targets[self.item])):
            reason += f": {blocker}"
        if known.drops >= MIN_DROPS_OF_HEAVY_OBJECT:
            reason += f"; too heavy for the tool, or slippery: the tool dropped it {known.drops} times"
        cell.ledger.reject(self.item, reason)
