"""Pictures of a run: camera image and detections, for each selected target and each failed attempt."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from executive import events
from executive.cell.frame import Frame, FrameCaptured
from executive.events import DetectedObject, FrameSearched, NodeEnded, TargetSelected, TimedEvent
from executive.record.run_directory import replace_atomically
from executive.record.timeline import Timeline, get_skill_name

MAX_STORED_LOOKS = 24
"""Maximum number of stored looks; a look is an image (1.2 MB at 640 x 480 pixels) with its detections."""
MAX_PICTURES = 200
"""Maximum number of pictures of a run, the newest, so that a long run does not fill the disk."""
PICTURE_WIDTH = 640
"""Width of a picture [pixel]; labels of boxes are legible at this width."""
CAPTION_HEIGHT = 24
"""Height of the line of text below the camera image [pixel]."""
PALETTE = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00")
"""Colours of classes; colour-blind people can distinguish these colours, and black text on them is legible.

Source: Okabe and Ito, "Color Universal Design", 2008, without black.
"""
LINE_WIDTH = 1
SELECTED_LINE_WIDTH = 3
"""Line widths of a box and of the selected box [pixel]."""
JPEG_QUALITY = 80
"""JPEG quality of pictures and of the image of the live page, 0 to 100."""
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_TEXT_SCALE = 0.4


@dataclass(frozen=True, eq=False)
class PictureContent:
    """Content of a picture.

    Attributes:
        image: Camera image `(H, W, 3)`, RGB.
        detections: All detections in the image.
        selected_index: Index in `detections` of the detection of `item`, or None.
        item: Name of the selected item, or "".
        classes: Detected classes; the index of a class determines its colour.
        caption: Line of text below the image.
    """

    image: NDArray[np.uint8]
    detections: Sequence[DetectedObject]
    selected_index: int | None
    item: str
    classes: Sequence[str]
    caption: str


class PictureRecorder:
    """Observer that saves a picture of each selected target and of each failed attempt.

    `<tick>_<item>.jpg` shows the image in which an item was selected. After a failed attempt to pick an item,
    `<tick>_<item>_<reason>.jpg` shows the image in which the item was selected last. After the failure of a
    skill without an item, `<tick>_<reason>.jpg` shows the last image, unless another picture shows it. At the
    end of the run, `<tick>_<item>.jpg` shows the last image of each rejected item of no class. What no item
    explains is in a picture `<tick>_<name>.jpg`.

    Args:
        folder: Folder of the pictures.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # A picture takes 8 ms, longer than a control step. Any first task starts the thread; otherwise, the
        # first picture would start it during a control step.
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="pictures")
        self._thread.submit(int)
        self._timeline = Timeline(has_history=False)
        self._last_frame: Frame | None = None
        self._look_by_frame_id: dict[int, tuple[Frame, FrameSearched]] = {}
        self._unknown_labels: set[str] = set()
        """Labels that are no class of the cell, in all looks."""
        self._selected_frame_id: int | None = None
        self._undrawn_frame_id: int | None = None
        """Number of the frame of the last look; None if a picture shows this frame."""
        self._unexplained_names: set[str] = set()
        """Names of all that no item explains and that a picture shows."""
        self._files: deque[Path] = deque()
        self.problem = ""
        """Message about the first missing picture, or ""."""

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
        elif isinstance(event, events.RunEnded):
            for name, last in self._timeline.items.changes.items():
                look = self._timeline.items.histories[name].look
                if last.state == "rejected" and look and last.label in self._unknown_labels:
                    self._queue(timed, TargetSelected(name, last.label, look.frame, ""), None)
        elif isinstance(event, events.UnexplainedChanged) and event.is_open and event.frame:
            self._draw_unexplained(timed, event)
        if isinstance(event, events.ItemChanged | events.BinsEmptied | FrameSearched | TargetSelected):
            self._timeline(timed)

    def close(self, *, wait: bool = True) -> None:
        """Draw all queued pictures; if `wait` is False, only finish the current picture."""
        self._thread.shutdown(wait=wait, cancel_futures=not wait)

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

    def _draw_unexplained(self, timed: TimedEvent, event: events.UnexplainedChanged) -> None:
        """Queue a picture of what no item explains, when the first frame shows it."""
        frame = self._last_frame
        if event.name in self._unexplained_names or frame is None or frame.id != event.frame:
            return
        self._unexplained_names.add(event.name)
        shown = [DetectedObject("", 0.0, event.box, [0.0] * 3, "")] if event.box else []
        caption = _make_caption(timed.clock, frame, None, None) + event.text
        picture = PictureContent(frame.image, shown, 0 if shown else None, event.name, (), caption)
        self._thread.submit(self._save, self._folder / f"{timed.tick:06d}_{event.name}.jpg", picture)

    def _queue(self, timed: TimedEvent, selection: TargetSelected | None, failure: NodeEnded | None) -> None:
        """Queue a picture of the frame of the selection; without a selection, of the last undrawn frame."""
        frame_id = selection.frame if selection else self._undrawn_frame_id
        if frame_id is None:
            return
        if frame_id == self._undrawn_frame_id:
            self._undrawn_frame_id = None
        look = self._look_by_frame_id.get(frame_id)
        if look is None:
            self.problem = (
                self.problem or f"missing pictures: only the last {MAX_STORED_LOOKS} images are kept"
            )
            return
        item = selection.item if selection else ""
        name = "_".join(filter(None, (f"{timed.tick:06d}", item, failure.reason if failure else "")))
        frame, look_event = look
        last = self._timeline.items.changes.get(item)
        position = last.position if last else None
        selected_index = _find_selected_index(selection, look_event.confident, position)
        caption = _make_caption(timed.clock, frame, selection, failure)
        classes = tuple(self._timeline.items.classes)
        picture = PictureContent(frame.image, look_event.confident, selected_index, item, classes, caption)
        self._thread.submit(self._save, self._folder / f"{name}.jpg", picture)

    def _save(self, path: Path, picture: PictureContent) -> None:
        try:
            data = encode_jpeg(draw_picture(picture))
            path.parent.mkdir(parents=True, exist_ok=True)
            with replace_atomically(path) as temporary_file:
                temporary_file.write_bytes(data)
            self._files.append(path)
            if len(self._files) > MAX_PICTURES:
                self._files.popleft().unlink(missing_ok=True)
        except Exception as error:
            # Only the text of the first error is stored: an exception would keep all images in memory.
            self.problem = self.problem or f"not every picture was drawn: {error}"


def encode_jpeg(image: NDArray[np.uint8]) -> bytes:
    """Return an image `(H, W, 3)`, RGB, as the content of a JPEG file."""
    _, data = cv2.imencode(".jpg", image[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()


def find_picture(folder: Path, item: str, reason: str) -> Path | None:
    """Return the file of the last picture of a failure or a selection, or None without such a picture.

    `item` is "" for a failure without an item; `reason` is "" for the last selection of the item.
    """
    name_after_tick = "_".join(filter(None, (item, reason)))
    pictures = [file for file in folder.glob("*.jpg") if split_picture_name(file)[1] == name_after_tick]
    return max(pictures, key=split_picture_name, default=None)


def split_picture_name(file: Path) -> tuple[int, str]:
    """Return the control step and the rest `<item>_<reason>` of the name of a picture; 0 without a step."""
    tick, _, subject = file.stem.partition("_")
    return int(tick) if tick.isdecimal() else 0, subject


def draw_picture(picture: PictureContent) -> NDArray[np.uint8]:
    """Return the scaled image with its boxes and labels, above the caption: `(H, PICTURE_WIDTH, 3)`, RGB."""
    scale = PICTURE_WIDTH / picture.image.shape[1]
    scaled_height = round(scale * picture.image.shape[0])
    canvas = np.zeros((scaled_height + CAPTION_HEIGHT, PICTURE_WIDTH, 3), np.uint8)
    canvas[:scaled_height] = cv2.resize(picture.image, (PICTURE_WIDTH, scaled_height))
    for index, detection in enumerate(picture.detections):
        is_selected = index == picture.selected_index
        name = picture.item if is_selected else detection.label
        left, top, right, bottom = (round(side * scale) for side in detection.box)
        colour = _choose_colour(detection.label, picture.classes)
        line_width = SELECTED_LINE_WIDTH if is_selected else LINE_WIDTH
        cv2.rectangle(canvas, (left, top), (right, bottom), colour, line_width)
        label = f"{name} {detection.confidence:.2f}" if detection.label else name
        (label_width, label_height), _ = cv2.getTextSize(label, _FONT, _TEXT_SCALE, 1)
        baseline = max(top - 3, label_height + 2)
        label_region = (left, baseline - label_height - 2, label_width, label_height + 5)
        cv2.rectangle(canvas, label_region, colour, cv2.FILLED)
        cv2.putText(canvas, label, (left, baseline), _FONT, _TEXT_SCALE, (0, 0, 0), 1, cv2.LINE_AA)
    baseline = scaled_height + CAPTION_HEIGHT - 8
    cv2.putText(canvas, picture.caption, (6, baseline), _FONT, _TEXT_SCALE, (255, 255, 255), 1, cv2.LINE_AA)
    return canvas


def _choose_colour(label: str, classes: Sequence[str]) -> tuple[int, ...]:
    """Return the colour of a class from its index in `classes`; white for an unknown class."""
    colour = PALETTE[classes.index(label) % len(PALETTE)] if label in classes else "#FFFFFF"
    return tuple(bytes.fromhex(colour.removeprefix("#")))


def _make_caption(
    clock: float, frame: Frame, selection: TargetSelected | None, failure: NodeEnded | None
) -> str:
    """Return time, failure or destination of the item, and camera with the age of its image."""
    text = ""
    if failure is not None:
        text = f"{get_skill_name(failure.node)}.{failure.reason}: {failure.message}"
    elif selection is not None:
        text = f"{selection.item} to {selection.bin}" if selection.bin else selection.item
    return f"{clock:.2f} s   {frame.camera}, {clock - frame.stamp:.2f} s old   {text}"


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
