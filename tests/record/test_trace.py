"""Hash over every decision of a run."""

from __future__ import annotations

import hashlib
import json

import pytest
from events import at, frame_searched, item_changed, run_ended, run_started

from executive.events import NodeEnded, NodeStarted, TargetSelected, TimedEvent, ToolCommanded
from executive.record.journal_format import decode_event, encode_event
from executive.record.recorder import Trace

FAILED = NodeEnded("sort/Grasp", "FAILURE", "Grasp", "cube-1", "missed", "no seal")
EVENTS = [
    at(0, run_started()),
    at(1, NodeStarted("sort")),
    at(2, NodeStarted("sort/Grasp", "Grasp", "cube-1")),
    at(3, FAILED),
    at(3, NodeEnded("sort/Look", "SUCCESS", "Look", outputs={"p": [0.1, 0.2]})),
    at(3, NodeEnded("sort", "FAILURE", reason="Grasp.missed", message="no seal", origin="sort/Grasp")),
    at(4, frame_searched()),
    at(5, TargetSelected("cube-1", "cube", 1, "red_bin")),
    at(6, item_changed("cube-1", "placed", bin="red_bin", label="größe", position=[0.3333, 0.0, 0.0])),
]
HASHED = [
    [1, "status", "sort", "RUNNING", None, None, None],
    [2, "status", "sort/Grasp", "RUNNING", "", "cube-1", None],
    [3, "status", "sort/Grasp", "FAILURE", "missed", "cube-1", None],
    [3, "status", "sort/Look", "SUCCESS", "", "", {"p": [0.1, 0.2]}],
    [3, "status", "sort", "FAILURE", "Grasp.missed", None, None],
    [5, "decision", "cube-1", "cube", 1],
    [6, "item", "cube-1", "placed", "größe", [0.3333, 0.0, 0.0], "red_bin"],
]


def digest(*events: TimedEvent) -> str:
    trace = Trace()
    for event in events:
        trace(event)
    return trace.hexdigest()


def test_one_line_of_compact_json_is_hashed_per_decision():
    lines = [json.dumps(line, sort_keys=True, separators=(",", ":")) + "\n" for line in HASHED]
    assert digest(*EVENTS) == hashlib.sha256("".join(lines).encode()).hexdigest()[:16]


def test_the_journal_gives_the_same_trace():
    assert digest(*(decode_event(encode_event(event)) for event in EVENTS)) == digest(*EVENTS)


@pytest.mark.parametrize("event", [run_started(), frame_searched(), ToolCommanded("open"), run_ended()])
def test_events_that_decide_nothing_do_not_count(event):
    assert digest(at(3, event)) == digest()
