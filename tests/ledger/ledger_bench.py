"""A ledger with a camera above it, for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.frame import Detection, Detections, ErrorRates, Frame, Observation
from executive.cell.objects import Bin, ObjectClass, Target
from executive.events import Event
from executive.ledger.tracker import Tracker
from executive.testing.fake_cell import load_empty_cell
from tests.camera_poses import looking_down

EYE = ErrorRates(threshold=0.5, miss_rate=0.03, confusion_rate=0.004, false_detections=0.02, jitter=1.0)

Thing = tuple[str, float, float]


def take_frame(number: int = 1, change_count: int = 0, hidden: slice = slice(0, 0)) -> Frame:
    """A frame from above; the columns `hidden` of the image are behind the arm."""
    visible = np.ones((480, 640), bool)
    visible[:, hidden] = False
    matrix = np.array([[461.0, 0, 320.0], [0, 461.0, 240.0], [0, 0, 1.0]])
    image = np.zeros((1, 1, 3), np.uint8)
    X_WC = looking_down((0.5, 0.0, 1.2))
    return Frame(number, "camera", image, None, matrix, X_WC, float(number), visible, change_count)


def area_of(view: str) -> tuple[float, float, float, float]:
    """The part of the image that is searched."""
    return (192.0, 100.0, 448.0, 356.0) if view == "table" else (0.0, 0.0, 640.0, 480.0)


class Bench:
    """A ledger with a camera above it that sees exactly what a test says."""

    def __init__(self, classes: dict[str, ObjectClass] | None = None) -> None:
        self.config = LedgerConfig()
        self.events: list[Event] = []
        size = np.array([0.22, 0.24, 0.06])
        slots = np.array([(x, y) for y in (0.08, 0.0, -0.08) for x in (-0.05, 0.05)])
        positions = {"red_bin": (0.2, -0.44, 0), "pink_bin": (0.2, 0.44, 0), "grey_bin": (-0.2, 0.44, 0)}
        bins = {
            name: Bin(name, np.array(position), size, slots + position[:2])
            for name, position in positions.items()
        }
        routes = {"cube": ("red_bin", "pink_bin")}
        emit = self.events.append
        classes = classes or {}
        labels = load_empty_cell().tool.find_distinct_labels(classes)
        self.ledger = Tracker(
            self.config, TableConfig(), bins, classes, routes, {}, emit, distinct_labels=labels
        )
        self.frames = 0

    def look(
        self,
        *things: Thing,
        view: str = "table",
        change_count: int | None = None,
        by: ErrorRates = EYE,
        hidden: slice = slice(0, 0),
        unsure: Sequence[Thing] = (),
        contradiction: str = "",
        unknown: Sequence[str] = (),
        detector: str = "eye",
    ) -> Sequence[Target]:
        """Look; the columns `hidden` of the image are behind the arm, and of some things it is `unsure`.

        `contradiction` is the reason for that, and `unknown` are labels that the cell does not know.
        """
        self.frames += 1
        frame = take_frame(
            self.frames, self.ledger.change_count if change_count is None else change_count, hidden
        )
        found = tuple(Detection(label, 0.9, (0, 0, 1, 1)) for label, _, _ in things)
        strange = tuple(Detection(label, 0.9, (0, 0, 1, 1)) for label in unknown)
        area = area_of(view)
        self.last_look = (
            Detections(detector, found, by, unknown=strange, frame=frame, view=view, area=area),
            [
                *(self._observe(frame, by, thing, 0.4, contradiction) for thing in unsure),
                *(self._observe(frame, by, thing, 0.9) for thing in things),
            ],
        )
        targets = self.ledger.observe(*self.last_look)
        if view == "full":
            self.ledger.observe_regions(self.last_look[0], ())
        return targets

    def verify(self, item: str, *things: Thing, **options: Any) -> str:
        """Look at the whole image, and return whether an item is at its place."""
        self.look(*things, view="full", **options)
        return self.ledger.update_presence(item, *self.last_look).value

    def _observe(
        self, frame: Frame, by: ErrorRates, thing: Thing, confidence: float, contradiction: str = ""
    ) -> Observation:
        label, x, y = thing
        position = np.array([x, y, 0.025])
        std = by.jitter * frame.compute_depth(position) / float(frame.matrix[0, 0])
        detection = Detection(label, confidence, (0, 0, 1, 1))
        is_confident = confidence >= by.threshold
        return Observation(detection, position, std, frame.stamp, is_confident, contradiction)

    def overlooked(self, x: float, y: float) -> float:
        """The chance that an object at a place has been overlooked."""
        return self.ledger._coverage.find_miss_probability(np.array([x, y, 0.025]))

    def drop(self, item: str, landing: np.ndarray | None = None) -> None:
        """Have the tool pick an item and lose it on the way."""
        self.ledger.record_grasp(item)
        self.ledger.record_drop(item, landing)

    def place(self, item: str, bin: str = "red_bin") -> None:
        """Have the tool pick an item and let it go in a bin."""
        self.ledger.record_grasp(item)
        self.ledger.record_placement(item, bin)

    def states(self) -> dict[str, tuple[str, str]]:
        """State of each item, and where it was placed or why it is in that state."""
        records = self.ledger.records
        return {record.item: (record.state.value, record.bin or record.reason) for record in records}

    def end(self, *, completed: bool = True) -> dict[str, tuple[str, str]]:
        """End the run and return the final states; `completed` is True if the tree succeeded."""
        self.ledger.set_final_states(completed=completed)
        return self.states()
