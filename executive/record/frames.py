"""The pictures behind the decisions: one file per choice, failed attempt and look that led to nothing."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.events import Event
from executive.record.pictures.drawer import Drawer
from executive.record.pictures.scene import Scene
from executive.record.progress import Progress, is_skill, skill_name

KEPT = 24
"""Looks remembered [1.2 MB each at 640 x 480]: a decision may rest on an earlier one than the last."""

MOST = 200
"""Pictures of a run, so that one that goes on for hours does not fill the disk."""


class Frames:
    """Saves a picture for every decision and every failure that an image can explain.

    `<tick>_<item>.jpg` shows what a decision was made from, `<tick>_<item>_<reason>.jpg` the same image
    again after the attempt failed, `<tick>_<reason>.jpg` the last look when a skill that is about no item
    fails and no other picture shows that look.
    """

    def __init__(self, folder: Path) -> None:
        self._drawer = Drawer(folder)
        self._progress = Progress()
        self._looks: dict[int, tuple[Frame, Mapping[str, Any]]] = {}
        self._choices: dict[str, Event] = {}
        self._rests_on: int | None = None
        self._unshown: int | None = None
        self._drawn = 0
        self._left_out: Counter[str] = Counter()

    def __call__(self, event: Event) -> None:
        """Remember a look; at a decision or a failure, have the frame it rests on drawn."""
        if event.kind == "look" and event.data.get("frame_object") is not None:
            self._remember(event)
        elif event.kind == "decision" and "frame" in event.data:
            self._choices[event.data["item"]] = event
            self._rests_on = event.data["frame"]
            self._show(event, event.data["frame"], event.data)
        elif event.kind == "status" and event.data["status"] == "FAILURE" and is_skill(event.data):
            self._fail(event)
        # Last: a skill that fails now is still what the robot was doing.
        self._progress(event)

    def close(self, *, wait: bool = True) -> None:
        """Finish the waiting pictures, without `wait` only the one under way."""
        self._drawer.close(wait=wait)

    @property
    def problem(self) -> str:
        """Why pictures are missing, or "" where none is."""
        left_out = ", ".join(f"{count} {why}" for why, count in self._left_out.items())
        return self._drawer.problem or (f"pictures left out: {left_out}" if left_out else "")

    def _remember(self, event: Event) -> None:
        frame = event.data["frame_object"]
        said = {key: event.data.get(key, "") for key in ("detector", "found")}
        # Depth, which a picture does not need, is three times as large as the rest.
        self._looks[frame.id] = replace(frame, depth=None), said
        self._unshown = frame.id
        if len(self._looks) > KEPT:
            # What the last decision rests on is wanted again if the attempt fails, however many looks later.
            del self._looks[next(number for number in self._looks if number != self._rests_on)]

    def _fail(self, event: Event) -> None:
        choice = self._choices.get(event.data["item"])
        if choice is not None:
            self._show(event, choice.data["frame"], choice.data)
        elif self._unshown is not None:
            self._show(event, self._unshown, {})

    def _show(self, event: Event, frame: int, choice: Mapping[str, Any]) -> None:
        """Have the look with that number drawn, with what was chosen in it and what is said now."""
        if frame == self._unshown:
            self._unshown = None
        look = self._looks.get(frame)
        if look is None:
            self._left_out[f"of a look before the last {KEPT}"] += 1
        elif self._drawn == MOST:
            self._left_out[f"beyond the {MOST} that a run keeps"] += 1
        elif not self._drawer.draw(_file(event, choice), self._scene(event, look, choice)):
            self._left_out["that came faster than they can be drawn"] += 1
        else:
            self._drawn += 1

    def _scene(self, event: Event, look: tuple[Frame, Mapping[str, Any]], choice: Mapping[str, Any]) -> Scene:
        frame, said = look
        item = choice.get("item", "")
        known = self._progress.item(item)
        reason = event.data.get("reason", "")
        return Scene(
            image=frame.image,
            visible=frame.visible,
            seen=[Detection(box["label"], box["confidence"], tuple(box["box"])) for box in said["found"]],
            chosen=_chosen(choice, said["found"], choice.get("position", known.get("position"))),
            mission=self._progress.mission,
            clock=event.clock,
            camera=frame.camera,
            detector=said["detector"],
            age=event.clock - frame.stamp,
            phase=self._progress.phase,
            item=item,
            bin=choice.get("bin", ""),
            attempts=known.get("attempts", 0),
            failure=f"{skill_name(event.data['node'])}.{reason}" if reason else "",
            message=event.data.get("message", ""),
            fates=self._progress.fates(),
            classes=self._progress.classes,
        )


def picture_of(folder: Path, item: str, reason: str) -> Path | None:
    """Return the last picture in `folder` of an item's failure for that reason; None where there is none.

    Without a reason it is that of the last decision for the item, without an item that of the last look.
    """
    about = "_".join(part for part in (item, reason) if part)
    pictures = [file for file in folder.glob("*.jpg") if file.stem.partition("_")[2] == about]
    return max(pictures, key=lambda file: int(file.stem.partition("_")[0]), default=None)


def _file(event: Event, choice: Mapping[str, Any]) -> str:
    """Return the name of the file that shows a choice at an event."""
    parts = (f"{event.tick:06d}", choice.get("item"), event.data.get("reason"))
    return "_".join(part for part in parts if part) + ".jpg"


def _chosen(
    choice: Mapping[str, Any], found: Sequence[Mapping[str, Any]], place: Sequence[float] | None
) -> int | None:
    """Return the number of the detection that was decided for, or None if it cannot be told.

    It is the one where the item was seen; an item's class is a matter of many looks, so the label of
    this one does not have to agree.
    """
    if not choice:
        return None
    located = [number for number, box in enumerate(found) if box.get("position") is not None]
    if place is not None and located:
        return min(located, key=lambda n: math.dist(found[n]["position"], place))
    alike = [number for number, box in enumerate(found) if box["label"] == choice.get("label")]
    return alike[0] if len(alike) == 1 else None
