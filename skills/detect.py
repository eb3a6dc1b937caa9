"""Skills that look with the camera: detection of objects, and verification that items are at their places."""

from __future__ import annotations

from collections.abc import Generator
from typing import ClassVar

from executive.cell.frame import Detections
from executive.cell.objects import Item
from executive.cell.protocols import Cell, Presence, Steps
from executive.manipulation.motions import capture_and_detect, complete, localize_and_observe
from executive.manipulation.tool_goals import is_detection_in_bin
from executive.skill import In, Out, Skill, SkillFailed, param, port


class LookingSkill(Skill):
    """Base class of skills that take a look with `capture_and_detect`."""

    detector: str = param("", refers_to="detector", doc="a detector of the cell; empty: the first detector")
    view: str = param("table", choices=("table", "full"), doc="`table`: the workspace; `full`: entire image")
    reasons: ClassVar[tuple[str, ...]] = ("unavailable", "crowded", "camera_moved")
    uses = ("camera",)
    senses = True


class Detect(LookingSkill):
    """Detect the objects in a new image, without blocking the tick loop.

    The output contains all detections that are not doubtful; it may be empty. A detection is doubtful if its
    confidence is below the threshold, or if its second class has more than half of this confidence.
    If all detections on the table are doubtful, the skill fails with `unsure`, or, with `doubtful: pass`,
    succeeds with an empty output. If the arm hides part of the workspace, the skill fails with `hidden`, or,
    with `hidden: pass`, detects objects in the visible part; the hidden part then counts as unknown.
    The skill fails with `crowded` if the detector reports more than 60 boxes of any confidence, and with
    `camera_moved` if the bins in the image are away from their expected positions.
    """

    detections: Out[Detections] = port(doc="the detections and their frame")
    doubtful: str = param("fail", choices=("fail", "pass"), doc="result if all table detections are doubtful")
    hidden: str = param("fail", choices=("fail", "pass"), doc="result if the arm hides part of the workspace")
    reasons = ("unsure", "hidden", *LookingSkill.reasons)

    def run(self, cell: Cell) -> Steps:
        """Capture a frame, send the frame to the detector, and wait for the answer."""
        camera = cell.camera
        if self.hidden == "fail" and not camera.sees_table():
            raise self.failure("hidden", f"the arm hides part of the workspace from camera {camera.name}")
        look = yield from capture_and_detect(cell, self.detector, self.view)
        on_table = (entry for entry in look.doubtful if not is_detection_in_bin(cell, entry, look.frame))
        if not look.confident and self.doubtful == "fail" and (best := next(on_table, None)):
            raise self.failure("unsure", look.describe_doubt(best))
        self.detections = look


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
