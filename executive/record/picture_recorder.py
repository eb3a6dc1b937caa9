"""Recorder of the pictures of a run: one file for each selected target and each failed attempt."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from executive.cell.frame import Frame, FrameCaptured
from executive.events import DetectedObject, FrameSearched, NodeEnded, RunEnded, TargetSelected, TimedEvent
from executive.record.pictures.drawing_thread import PictureDrawer
from executive.record.pictures.picture_content import PictureContent
from executive.record.timeline.activation import get_skill_name
from executive.record.timeline.timeline import Timeline

MAX_STORED_LOOKS = 24
"""Maximum number of stored looks; a look is an image (1.2 MB at 640 x 480 pixels) with its detections."""

MAX_PICTURES = 200
"""Maximum number of pictures of a run, so that a long run does not fill the disk."""

StoredLook = tuple[Frame, FrameSearched]
"""Frame without its depth image, and the event with the detections in the frame."""

_LISTED_STATES = ("held", "dropped", "rejected", "skipped", "lost")
"""States of items, except `placed`, that a picture lists."""


class PictureRecorder:
    """Observer that saves a picture of each selected target and of each failed attempt.

    `<tick>_<item>.jpg` shows the image in which an item was selected. After a failed attempt to pick an item,
    `<tick>_<item>_<reason>.jpg` shows the image in which the item was selected last. After the failure of a
    skill without an item, `<tick>_<reason>.jpg` shows the last image, unless another picture shows it. At the
    end of the run, `<tick>_<item>.jpg` shows the last image of each rejected item of no class.

    Args:
        folder: Folder of the pictures.
    """

    def __init__(self, folder: Path) -> None:
        self._drawer = PictureDrawer(folder)
        self._timeline = Timeline(has_history=False)
        self._last_frame: Frame | None = None
        self._look_by_frame_id: dict[int, StoredLook] = {}
        self._unknown_labels: set[str] = set()
        """Labels that are no class of the cell, in all looks."""
        self._selected_frame_id: int | None = None
        self._undrawn_frame_id: int | None = None
        """Number of the frame of the last look; None if a picture shows this frame."""
        self._picture_count = 0
        self._missing_picture_counts: Counter[str] = Counter()

    def __call__(self, timed: TimedEvent) -> None:
        """Store a look, or draw a picture after a selection or a failure."""
        event = timed.event
        if isinstance(event, FrameCaptured):
            # The depth image is not drawn and needs more memory than the image.
            self._last_frame = replace(event.frame, depth=None)
        elif isinstance(event, FrameSearched):
            self._add_look(event)
        elif isinstance(event, TargetSelected):
            self._selected_frame_id = event.frame
            self._queue(timed, event, None)
        elif isinstance(event, NodeEnded) and event.skill and event.status == "FAILURE":
            self._queue(timed, self._timeline.selections.get(event.item), event)
        elif isinstance(event, RunEnded):
            for name, item in self._timeline.items.by_name.items():
                label = item.last_change.label
                if item.last_change.state == "rejected" and item.sighting and label in self._unknown_labels:
                    self._queue(timed, TargetSelected(name, label, item.sighting.frame, ""), None)
        # The timeline gets the event last, so that the picture shows a failed skill as running.
        self._timeline(timed)

    def close(self, *, wait: bool = True) -> None:
        """Draw all queued pictures; if `wait` is False, only finish the current picture."""
        self._drawer.close(wait=wait)

    @property
    def problem(self) -> str:
        """Message about missing pictures, or ""."""
        missing = ", ".join(f"{count} {reason}" for reason, count in self._missing_picture_counts.items())
        return self._drawer.problem or (f"missing pictures: {missing}" if missing else "")

    def _add_look(self, look: FrameSearched) -> None:
        """Store a look with its frame, and remove the oldest look if the store is full."""
        if self._last_frame is None or self._last_frame.id != look.frame:
            return
        self._look_by_frame_id[look.frame] = self._last_frame, look
        self._unknown_labels.update(look.unknown_labels)
        self._undrawn_frame_id = look.frame
        if len(self._look_by_frame_id) > MAX_STORED_LOOKS:
            # The look of the last selection is kept for the picture of a failed attempt to pick the item.
            other_ids = (id for id in self._look_by_frame_id if id != self._selected_frame_id)
            del self._look_by_frame_id[next(other_ids)]

    def _queue(self, timed: TimedEvent, selection: TargetSelected | None, failure: NodeEnded | None) -> None:
        """Queue a picture of the frame of the selection; without a selection, of the last undrawn frame."""
        frame_id = selection.frame if selection else self._undrawn_frame_id
        if frame_id is None:
            return
        if frame_id == self._undrawn_frame_id:
            self._undrawn_frame_id = None
        look = self._look_by_frame_id.get(frame_id)
        if look is None:
            self._missing_picture_counts[f"because only the last {MAX_STORED_LOOKS} images are kept"] += 1
        elif self._picture_count == MAX_PICTURES:
            self._missing_picture_counts[f"after the first {MAX_PICTURES}"] += 1
        elif not self._drawer.queue(
            _make_file_name(timed, selection, failure), self._make_content(timed, look, selection, failure)
        ):
            self._missing_picture_counts["because of a full queue"] += 1
        else:
            self._picture_count += 1

    def _make_content(
        self, timed: TimedEvent, look: StoredLook, selection: TargetSelected | None, failure: NodeEnded | None
    ) -> PictureContent:
        """Return the content of the picture of `look` in the current state of the run."""
        frame, look_event = look
        timeline, running = self._timeline, self._timeline.find_running_activations()
        item = selection.item if selection else ""
        history = timeline.items.by_name.get(item)
        position = history.last_change.position if history else None
        return PictureContent(
            image=frame.image,
            visible=frame.visible,
            detections=look_event.confident,
            selected_index=_find_selected_index(selection, look_event.confident, position),
            mission=timeline.started.mission if timeline.started else "",
            clock=timed.clock,
            camera=frame.camera,
            detector=look_event.detector,
            age=timed.clock - frame.stamp,
            running_skills=[get_skill_name(each.node) for each in running if each.skill],
            item=item,
            bin=selection.bin if selection else "",
            failed_attempts=history.last_change.attempts if history else 0,
            failure=f"{get_skill_name(failure.node)}.{failure.reason}" if failure else "",
            message=failure.message if failure else "",
            outcomes=_group_items(timeline),
            classes=tuple(timeline.items.classes),
        )


def _group_items(timeline: Timeline) -> dict[str, list[str]]:
    """Return the names of placed items by bin, then of other items by state, in the order of changes."""
    placed: dict[str, list[str]] = defaultdict(list)
    unplaced: dict[str, list[str]] = defaultdict(list)
    for item in sorted(timeline.items.by_name.values(), key=lambda item: item.last_change_number):
        state = item.last_change.state
        if state == "placed":
            placed[item.last_change.bin].append(item.last_change.item)
        elif state in _LISTED_STATES:
            unplaced["in the tool" if state == "held" else state].append(item.last_change.item)
    return placed | unplaced


def find_picture(folder: Path, item: str, reason: str) -> Path | None:
    """Return the file of the last picture of a failure or a selection, or None without such a picture.

    `item` is "" for a failure without an item; `reason` is "" for the last selection of the item.
    """
    name_after_tick = "_".join(filter(None, (item, reason)))
    pictures = [file for file in folder.glob("*.jpg") if file.stem.partition("_")[2] == name_after_tick]
    return max(pictures, key=lambda file: int(file.stem.partition("_")[0]), default=None)


def _make_file_name(timed: TimedEvent, selection: TargetSelected | None, failure: NodeEnded | None) -> str:
    """Return the file name of the picture of a selection or a failure."""
    parts = (f"{timed.tick:06d}", selection.item if selection else "", failure.reason if failure else "")
    return "_".join(filter(None, parts)) + ".jpg"


def _find_selected_index(
    selection: TargetSelected | None, objects: Sequence[DetectedObject], position: Sequence[float] | None
) -> int | None:
    """Return the index in `objects` of the selected item, last seen at `position`; None if unknown."""
    if selection is None:
        return None
    # The labels are not compared, because the ledger derives the class of an item from all looks.
    if position is not None and objects:
        return min(range(len(objects)), key=lambda index: math.dist(objects[index].position, position))
    indices = [index for index, each in enumerate(objects) if each.label == selection.label]
    return indices[0] if len(indices) == 1 else None
