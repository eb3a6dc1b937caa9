"""Events of the ledger: looks, items and targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from executive.events.event import Event


@dataclass(frozen=True)
class DetectedObject:
    """A localized detection in a frame.

    Attributes:
        label: Class.
        confidence: Confidence of the detector, 0 to 1.
        box: Left, top, right and bottom side [pixel].
        position: Position in the world `(3,)` [m].
        contradiction: Evidence against the class besides the detector's score, or "".
    """

    label: str
    confidence: float
    box: Annotated[Sequence[float], Field(min_length=4, max_length=4)]
    position: Annotated[Sequence[float], Field(min_length=3, max_length=3)]
    contradiction: str

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True, extra="forbid")


@dataclass(frozen=True)
class FrameSearched(Event):
    """A detector searched a frame, and the ledger received its detections.

    Attributes:
        frame: Number of the frame.
        camera: Name of the camera.
        detector: Name of the detector.
        view: Searched part of the frame: `table` or `full`.
        found: Confident detections.
        unsure: Detections of low confidence.
        unknown: Labels that the cell file does not declare, one for each detection.
    """

    frame: int
    camera: str
    detector: str
    view: str
    found: Sequence[DetectedObject]
    unsure: Sequence[DetectedObject]
    unknown: Sequence[str]


@dataclass(frozen=True)
class ItemChanged(Event):
    """The ledger changed an item.

    Attributes:
        item: Name of the item.
        label: Class of the item.
        state: `seen`, `held`, `dropped`, `placed`, `rejected`, `skipped`, `lost` or `phantom`.
        position: Position of the item `(3,)` [m].
        looks: Number of looks that showed the item.
        attempts: Number of failed attempts to pick the item.
        bin: Bin that contains the placed item, or "".
        why: Reason of the state, or "".
    """

    item: str
    label: str
    state: str
    position: Annotated[Sequence[float], Field(min_length=3, max_length=3)]
    looks: int
    attempts: int
    bin: str
    why: str


@dataclass(frozen=True)
class TargetSelected(Event):
    """A skill selected the next target.

    Attributes:
        item: Name of the item.
        label: Class of the item.
        frame: Number of the last frame that showed the item.
        bin: Destination of the item.
    """

    item: str
    label: str
    frame: int
    bin: str
