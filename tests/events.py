"""Events with default values for the fields that a test is not about."""

from __future__ import annotations

from typing import Any

from executive.events import (
    DetectedObject,
    Event,
    FrameSearched,
    InputRead,
    ItemChanged,
    NodeEnded,
    NodeStarted,
    RunEnded,
    RunStarted,
    TimedEvent,
)

STEP = 1 / 240


def at(tick: int, event: Event, clock: float | None = None) -> TimedEvent:
    """Return an event at a control step."""
    return TimedEvent(tick, tick * STEP if clock is None else clock, event)


def run_started(**fields: Any) -> RunStarted:
    """Return the start of a run."""
    defaults: dict[str, Any] = {
        "mission": "sort", "file": "sort.yaml", "seed": 3, "params": {}, "overrides": {}, "requests": None,
        "base": ".", "step": STEP, "versions": {},
    }  # fmt: skip
    return RunStarted(**defaults | fields)


def run_ended(status: str = "SUCCESS", **fields: Any) -> RunEnded:
    """Return the end of a run."""
    defaults: dict[str, Any] = {
        "reason": "", "message": "", "node": "", "is_table_empty": False, "held_item": "", "ticks": 1,
        "robot_time": 0.0,
    }  # fmt: skip
    return RunEnded(status, **defaults | fields)


def item_changed(item: str, state: str = "seen", **fields: Any) -> ItemChanged:
    """Return a change of an item, whose class is the first part of its name."""
    defaults: dict[str, Any] = {
        "label": item.partition("-")[0], "position": [0.5, 0.0, 0.02], "looks": 1, "attempts": 0, "bin": "",
        "reason": "",
    }  # fmt: skip
    return ItemChanged(item, state=state, **defaults | fields)


def detected(label: str, **fields: Any) -> DetectedObject:
    """Return a localized detection."""
    defaults: dict[str, Any] = {
        "confidence": 0.9, "box": [20.0, 40.0, 50.0, 70.0], "position": [0.5, 0.1, 0.02], "contradiction": "",
    }  # fmt: skip
    return DetectedObject(label, **defaults | fields)


def frame_searched(*found: DetectedObject, **fields: Any) -> FrameSearched:
    """Return a look with confident detections."""
    defaults: dict[str, Any] = {
        "frame": 1, "camera": "overhead", "detector": "embedded", "view": "table", "doubtful": [],
        "unknown_labels": [],
    }  # fmt: skip
    return FrameSearched(confident=list(found), **defaults | fields)


def skill_started(node: str, item: str = "") -> NodeStarted:
    """Return the start of a skill, whose name is the last part of its path."""
    return NodeStarted(node, node.rpartition("/")[2], item)


def skill_ended(node: str, status: str = "SUCCESS", item: str = "", **fields: Any) -> NodeEnded:
    """Return the end of a skill, whose name is the last part of its path."""
    return NodeEnded(node, status, node.rpartition("/")[2], item, **fields)


def read(name: str, value: Any, nth: int = 1, raised: str = "") -> InputRead:
    """Return an answer of the cell."""
    return InputRead(name, nth, value, raised)
