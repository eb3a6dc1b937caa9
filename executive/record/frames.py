"""The pictures behind the decisions: one file per choice, failed attempt and look that led to nothing."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from executive.cell.detection import Detection
from executive.cell.frame import Frame, FrameTaken
from executive.events import DetectedObject, FrameSearched, NodeEnded, TargetSelected, TimedEvent
from executive.record.pictures.drawer import Drawer
from executive.record.pictures.scene import PictureScene
from executive.record.timeline.activation import skill_name
from executive.record.timeline.timeline import Timeline

KEPT = 24
"""Looks remembered [1.2 MB each at 640 x 480]: a decision may rest on an earlier one than the last."""

MOST = 200
"""Pictures of a run, so that one that goes on for hours does not fill the disk."""

_OPEN_STATES = ("held", "dropped", "rejected", "skipped", "lost")


class Frames:
    """Saves a picture for every decision and every failure that an image can explain.

    `<tick>_<item>.jpg` shows what a decision was made from, `<tick>_<item>_<reason>.jpg` the same image
    again after the attempt failed, `<tick>_<reason>.jpg` the last look when a skill that is about no item
    fails and no other picture shows that look.
    """

    def __init__(self, folder: Path) -> None:
        self._drawer = Drawer(folder)
        self._timeline = Timeline(history=False)
        self._taken: Frame | None = None
        self._looks: dict[int, tuple[Frame, FrameSearched]] = {}
        self._rests_on: int | None = None
        self._unshown: int | None = None
        self._drawn = 0
        self._left_out: Counter[str] = Counter()

    def __call__(self, timed: TimedEvent) -> None:
        """Remember a look; at a decision or a failure, have the frame it rests on drawn."""
        event = timed.event
        if isinstance(event, FrameTaken):
            # Depth, which a picture does not need, is three times as large as the rest.
            self._taken = replace(event.frame, depth=None)
        elif isinstance(event, FrameSearched):
            self._remember(event)
        elif isinstance(event, TargetSelected):
            self._rests_on = event.frame
            self._show(timed, event.frame, event, None)
        elif isinstance(event, NodeEnded) and event.skill and event.status == "FAILURE":
            self._show_failure(timed, event)
        # At last: a skill that fails now belongs to the phase that the picture names.
        self._timeline(timed)

    def close(self, *, wait: bool = True) -> None:
        """Finish the waiting pictures, without `wait` only the one under way."""
        self._drawer.close(wait=wait)

    @property
    def problem(self) -> str:
        """Why pictures are missing, or "" where none is."""
        left_out = ", ".join(f"{count} {why}" for why, count in self._left_out.items())
        return self._drawer.problem or (f"pictures left out: {left_out}" if left_out else "")

    def _remember(self, look: FrameSearched) -> None:
        if self._taken is None or self._taken.id != look.frame:
            return
        self._looks[look.frame] = self._taken, look
        self._unshown = look.frame
        if len(self._looks) > KEPT:
            # What the last decision rests on is wanted again if the attempt fails, however many looks later.
            del self._looks[next(number for number in self._looks if number != self._rests_on)]

    def _show_failure(self, timed: TimedEvent, failure: NodeEnded) -> None:
        choice = self._timeline.targets.get(failure.item)
        if choice is not None:
            self._show(timed, choice.frame, choice, failure)
        elif self._unshown is not None:
            self._show(timed, self._unshown, None, failure)

    def _show(
        self, timed: TimedEvent, frame: int, choice: TargetSelected | None, failure: NodeEnded | None
    ) -> None:
        """Have a look drawn, with the choice that rests on it and the failure of the attempt."""
        if frame == self._unshown:
            self._unshown = None
        look = self._looks.get(frame)
        if look is None:
            self._left_out[f"of a look before the last {KEPT}"] += 1
        elif self._drawn == MOST:
            self._left_out[f"beyond the {MOST} that a run keeps"] += 1
        elif not self._drawer.draw(_file(timed, choice, failure), self._scene(timed, look, choice, failure)):
            self._left_out["that came faster than they can be drawn"] += 1
        else:
            self._drawn += 1

    def _scene(
        self,
        timed: TimedEvent,
        look: tuple[Frame, FrameSearched],
        choice: TargetSelected | None,
        failure: NodeEnded | None,
    ) -> PictureScene:
        frame, searched = look
        timeline = self._timeline
        item = choice.item if choice else ""
        known = timeline.items.by_name.get(item)
        return PictureScene(
            image=frame.image,
            visible=frame.visible,
            seen=[_detection(one) for one in searched.found],
            chosen=_chosen(choice, searched.found, known.now.position if known else None),
            mission=timeline.started.mission if timeline.started else "",
            clock=timed.clock,
            camera=frame.camera,
            detector=searched.detector,
            age=timed.clock - frame.stamp,
            phase=" + ".join(skill_name(one.node) for one in timeline.running() if one.skill),
            item=item,
            bin=choice.bin if choice else "",
            attempts=known.now.attempts if known else 0,
            failure=f"{skill_name(failure.node)}.{failure.reason}" if failure else "",
            message=failure.message if failure else "",
            fates=_fates(timeline),
            classes=tuple(timeline.items.classes),
        )


def _fates(timeline: Timeline) -> dict[str, list[str]]:
    """Return the items by bin, then those in no bin by state, in the order of their last changes of state."""
    bins: dict[str, list[str]] = defaultdict(list)
    others: dict[str, list[str]] = defaultdict(list)
    for item in sorted(timeline.items.by_name.values(), key=lambda item: item.changed):
        state = item.now.state
        if state == "placed":
            bins[item.now.bin].append(item.now.item)
        elif state in _OPEN_STATES:
            others["in the tool" if state == "held" else state].append(item.now.item)
    return bins | others


def picture_of(folder: Path, item: str, reason: str) -> Path | None:
    """Return the last picture in `folder` of an item's failure for that reason; None where there is none.

    Without a reason it is that of the last decision for the item, without an item that of the last look.
    """
    about = "_".join(part for part in (item, reason) if part)
    pictures = [file for file in folder.glob("*.jpg") if file.stem.partition("_")[2] == about]
    return max(pictures, key=lambda file: int(file.stem.partition("_")[0]), default=None)


def _file(timed: TimedEvent, choice: TargetSelected | None, failure: NodeEnded | None) -> str:
    """Return the name of the file that shows a choice or a failure."""
    parts = (f"{timed.tick:06d}", choice.item if choice else "", failure.reason if failure else "")
    return "_".join(part for part in parts if part) + ".jpg"


def _chosen(
    choice: TargetSelected | None, found: Sequence[DetectedObject], place: Sequence[float] | None
) -> int | None:
    """Return the number of the detection that was decided for, or None if it cannot be told.

    It is the one where the item was seen; an item's class is a matter of many looks, so the label of
    this one does not have to agree.
    """
    if choice is None:
        return None
    if place is not None and found:
        return min(range(len(found)), key=lambda number: math.dist(found[number].position, place))
    alike = [number for number, one in enumerate(found) if one.label == choice.label]
    return alike[0] if len(alike) == 1 else None


def _detection(found: DetectedObject) -> Detection:
    left, top, right, bottom = found.box
    return Detection(found.label, found.confidence, (left, top, right, bottom))
