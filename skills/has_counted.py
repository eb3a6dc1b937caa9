"""Condition that at least a number of items are placed or rejected."""

from __future__ import annotations

from executive.cell.protocols import Cell
from executive.skill import In, Skill, param, port


class HasCounted(Skill):
    """Check that at least a number of items are placed or rejected.

    `of_class` restricts the count to one class, `inside` to one bin. With `inside`, the count of rejected
    items is always 0.
    """

    of_class: In[str | None] = port(default=None, refers_to="class", doc="only items of this class")
    inside: In[str | None] = port(default=None, refers_to="bin", doc="only items in this bin")
    counter: str = param("placed", choices=("placed", "rejected"), doc="the state of the counted items")
    at_least: int = param(ge=1, doc="minimum number of items")
    is_condition = True
    reasons = ("too_few",)

    def run(self, cell: Cell) -> None:
        """Count the items once."""
        count = cell.ledger.count_items(self.counter, self.of_class, self.inside)
        if count < self.at_least:
            objects = f"items of class {self.of_class}" if self.of_class else "items"
            place = f" in {self.inside}" if self.inside else ""
            message = f"{count} of {self.at_least} required {objects} are {self.counter}{place}"
            raise self.failure("too_few", message)
