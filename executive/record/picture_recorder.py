"""Pictures of a run: one file for each selection of a target, each failed attempt and each failed look."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from executive.cell.detection import Detection
from executive.cell.frame import Frame, FrameCaptured
from executive.events import DetectedObject, FrameSearched, NodeEnded, TargetSelected, TimedEvent
from executive.record.pictures.drawer import Drawer
from executive.record.pictures.scene import PictureScene
from executive.record.timeline.activation import skill_name
from executive.record.timeline.timeline import Timeline

MAX_LOOKS = 24
"""Maximum number of looks in memory [1.2 MB each at 640 x 480]; a selection may use an older look."""

MAX_PICTURES = 200
"""Maximum number of pictures of a run, so that a long run does not fill the disk."""

_UNPLACED_STATES = ("held", "dropped", "rejected", "skipped", "lost")


class PictureRecorder:
    """Observer that saves a picture of each selected target and of each failure that an image can explain.

    `<tick>_<item>.jpg` shows the image from which an item was selected, `<tick>_<item>_<reason>.jpg` the same
    image after the attempt failed. `<tick>_<reason>.jpg` shows the last look after the failure of a skill
    without an item, unless another picture shows this look.

    Args:
        folder: Folder of the pictures.
    """

    def __init__(self, folder: Path) -> None:
        self._drawer = Drawer(folder)
        self._timeline = Timeline(history=False)
        self._last_frame: Frame | None = None
        self._looks: dict[int, tuple[Frame, FrameSearched]] = {}
        self._selected_frame: int | None = None
        self._unshown_frame: int | None = None
        self._picture_count = 0
        self._left_out: Counter[str] = Counter()

    def __call__(self, timed: TimedEvent) -> None:
        """Store a look; after a selection or a failure, draw the frame of the selection."""
        event = timed.event
        if isinstance(event, FrameCaptured):
            # Depth is not drawn and needs three times as much memory as the image.
            self._last_frame = replace(event.frame, depth=None)
        elif isinstance(event, FrameSearched):
            self._add_look(event)
        elif isinstance(event, TargetSelected):
            self._selected_frame = event.frame
            self._show(timed, event.frame, event, None)
        elif isinstance(event, NodeEnded) and event.skill and event.status == "FAILURE":
            self._show_failure(timed, event)
        # The timeline gets the event last, so that the picture names a failed skill as running.
        self._timeline(timed)

    def close(self, *, wait: bool = True) -> None:
        """Finish the queued pictures; if `wait` is False, finish only the current picture."""
        self._drawer.close(wait=wait)

    @property
    def problem(self) -> str:
        """Reason for which pictures are missing, or "" if none is missing."""
        left_out = ", ".join(f"{count} {reason}" for reason, count in self._left_out.items())
        return self._drawer.problem or (f"pictures left out: {left_out}" if left_out else "")

    def _add_look(self, look: FrameSearched) -> None:
        if self._last_frame is None or self._last_frame.id != look.frame:
            return
        self._looks[look.frame] = self._last_frame, look
        self._unshown_frame = look.frame
        if len(self._looks) > MAX_LOOKS:
            # The frame of the last selection is kept, because it is drawn again if the attempt fails.
            del self._looks[next(number for number in self._looks if number != self._selected_frame)]

    def _show_failure(self, timed: TimedEvent, failure: NodeEnded) -> None:
        selection = self._timeline.targets.get(failure.item)
        if selection is not None:
            self._show(timed, selection.frame, selection, failure)
        elif self._unshown_frame is not None:
            self._show(timed, self._unshown_frame, None, failure)

    def _show(
        self, timed: TimedEvent, frame: int, selection: TargetSelected | None, failure: NodeEnded | None
    ) -> None:
        """Draw a look with the target that was selected from the look and the failure of the attempt."""
        if frame == self._unshown_frame:
            self._unshown_frame = None
        look = self._looks.get(frame)
        if look is None:
            self._left_out[f"of a look before the last {MAX_LOOKS}"] += 1
        elif self._picture_count == MAX_PICTURES:
            self._left_out[f"beyond the {MAX_PICTURES} that a run keeps"] += 1
        elif not self._drawer.draw(
            _file_name(timed, selection, failure), self._make_scene(timed, look, selection, failure)
        ):
            self._left_out["that came faster than they can be drawn"] += 1
        else:
            self._picture_count += 1

    def _make_scene(
        self,
        timed: TimedEvent,
        look: tuple[Frame, FrameSearched],
        selection: TargetSelected | None,
        failure: NodeEnded | None,
    ) -> PictureScene:
        frame, searched = look
        timeline = self._timeline
        item = selection.item if selection else ""
        history = timeline.items.by_name.get(item)
        return PictureScene(
            image=frame.image,
            visible=frame.visible,
            detections=[_convert(found) for found in searched.found],
            selected=_find_selected(selection, searched.found, history.now.position if history else None),
            mission=timeline.started.mission if timeline.started else "",
            clock=timed.clock,
            camera=frame.camera,
            detector=searched.detector,
            age=timed.clock - frame.stamp,
            phase=" + ".join(skill_name(last.node) for last in timeline.find_running() if last.skill),
            item=item,
            bin=selection.bin if selection else "",
            attempts=history.now.attempts if history else 0,
            failure=f"{skill_name(failure.node)}.{failure.reason}" if failure else "",
            message=failure.message if failure else "",
            outcomes=_group_items(timeline),
            classes=tuple(timeline.items.classes),
        )


def _group_items(timeline: Timeline) -> dict[str, list[str]]:
    """Return the items by bin, then the unplaced items by state, ordered by their last changes of state."""
    bins: dict[str, list[str]] = defaultdict(list)
    others: dict[str, list[str]] = defaultdict(list)
    for item in sorted(timeline.items.by_name.values(), key=lambda item: item.changed):
        state = item.now.state
        if state == "placed":
            bins[item.now.bin].append(item.now.item)
        elif state in _UNPLACED_STATES:
            others["in the tool" if state == "held" else state].append(item.now.item)
    return bins | others


def find_picture(folder: Path, item: str, reason: str) -> Path | None:
    """Return the last picture of a failure in `folder`, or None if there is no such picture.

    Args:
        folder: Folder of the pictures.
        item: Item of the failed attempt; "" for a failure without an item.
        reason: Reason of the failure; "" for the last selection of the item.
    """
    subject = "_".join(filter(None, (item, reason)))
    pictures = [file for file in folder.glob("*.jpg") if file.stem.partition("_")[2] == subject]
    return max(pictures, key=lambda file: int(file.stem.partition("_")[0]), default=None)


def _file_name(timed: TimedEvent, selection: TargetSelected | None, failure: NodeEnded | None) -> str:
    """Return the file name of the picture of a selection or a failure."""
    parts = (f"{timed.tick:06d}", selection.item if selection else "", failure.reason if failure else "")
    return "_".join(filter(None, parts)) + ".jpg"


def _find_selected(
    selection: TargetSelected | None, found: Sequence[DetectedObject], position: Sequence[float] | None
) -> int | None:
    """Return the index of the detection of the selected item, or None if the index is unknown.

    The detection is the nearest one to the position of the item. Its label may differ from the class of the
    item, which results from many looks.
    """
    if selection is None:
        return None
    if position is not None and found:
        return min(range(len(found)), key=lambda index: math.dist(found[index].position, position))
    candidates = [index for index, detected in enumerate(found) if detected.label == selection.label]
    return candidates[0] if len(candidates) == 1 else None


def _convert(found: DetectedObject) -> Detection:
    left, top, right, bottom = found.box
    return Detection(found.label, found.confidence, (left, top, right, bottom))
