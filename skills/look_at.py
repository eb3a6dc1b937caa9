"""Skill that verifies that an item, or the items in a bin, are where the ledger believes them to be."""

from __future__ import annotations

from collections.abc import Generator

from executive.cell.ledger import Presence
from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import capture_and_detect, complete, localize_and_observe
from executive.skill import In, SkillFailed, param, port
from skills.detect import LookingSkill


class LookAt(LookingSkill):
    """Verify with the camera that an item, or each item in a bin, is where the ledger believes it to be.

    The skill does not move the arm: move first to a pose from which the camera sees the place. The skill
    succeeds if an image shows every item at its place. It fails with `gone` if enough images show the place
    without the item; the position of the item is then unknown, and the item may be sorted again if a later
    look finds an object of its class on the table. The skill fails with `hidden` if the item is in the tool,
    if its place is outside the image or occluded, or if `looks` images do not suffice for an answer, given
    the miss rate of the detector.
    """

    item: In[Item | None] = port(default=None, refers_to="item", doc="the item to verify")
    bin: In[str | None] = port(default=None, refers_to="bin", doc="the bin whose items are verified")
    view: str = param("full", choices=("table", "full"), doc="`table`: the workspace; `full`: entire image")
    looks: int = param(10, ge=1, le=100, doc="maximum number of images")
    one_of = ("item", "bin")
    reasons = ("gone", "hidden", *LookingSkill.reasons)

    def run(self, cell: Cell) -> Steps:
        """Take looks until all answers are certain, or until a place is not in view."""
        known_items = cell.ledger.list_known_items()
        items = [self.item] if self.item else [known.item for known in known_items if known.bin == self.bin]
        for _ in range(self.looks):
            answers = yield from self._observe_and_verify(cell, items)
            found = {answer: [item for item in items if answers[item] is answer] for answer in Presence}
            if gone_items := ", ".join(found[Presence.GONE]):
                raise self.failure("gone", f"not at its place any more: {gone_items}")
            if hidden_items := ", ".join(found[Presence.HIDDEN]):
                if (held := cell.ledger.find_held_item()) in found[Presence.HIDDEN]:
                    raise self.failure("hidden", f"{held} is in the tool")
                raise self.failure("hidden", f"the camera does not see the place of {hidden_items}")
            if not found[Presence.UNSURE]:
                return
        message = f"{self.looks} images are not enough to tell whether these items are at their places: "
        raise self.failure("hidden", message + ", ".join(found[Presence.UNSURE]))

    def _observe_and_verify(
        self, cell: Cell, items: list[Item]
    ) -> Generator[None, None, dict[Item, Presence]]:
        """Take a look, update the ledger, and return the answer for each item."""
        look = yield from capture_and_detect(cell, self.detector, self.view)
        try:
            observations, _ = complete(localize_and_observe(cell, look))
        except SkillFailed:
            # Objects may have moved since the capture while another branch of a `parallel` used the tool.
            return dict.fromkeys(items, Presence.UNSURE)
        return {item: cell.ledger.update_presence(item, look, observations) for item in items}
