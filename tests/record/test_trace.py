"""Hash over every decision of a run."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest

from executive.events import Event
from executive.record.entry import entry_of
from executive.record.trace import Trace

STATUS = {
    "node": "sort/Grasp", "status": "FAILURE", "reason": "missed", "message": "no seal", "item": "cube-1",
    "outputs": {"p": np.array([0.1, 0.2])},
}  # fmt: skip
PLACE = (1 / 3, 0, -0.0)
PLACED = {"item": "cube-1", "state": "placed", "bin": "red_bin", "label": "größe", "position": PLACE}
EVENTS = [
    Event("run", 0, 0.0, {"mission": "sort"}),
    Event("status", 3, 0.1, STATUS),
    Event("look", 4, 0.2, {"frame": 1}),
    Event("decision", 5, 0.3, {"item": "cube-1", "label": "cube", "frame": 1, "bin": "red_bin"}),
    Event("item", 6, 0.4, PLACED),
]
HASHED = [
    [3, "status", "sort/Grasp", "FAILURE", "missed", "cube-1", {"p": [0.1, 0.2]}],
    [5, "decision", "cube-1", "cube", 1],
    [6, "item", "cube-1", "placed", "größe", [0.333333, 0, 0.0], "red_bin"],
]


def digest(*events: Event) -> str:
    trace = Trace()
    for event in events:
        trace(event)
    return trace.hexdigest()


def test_one_line_of_compact_json_is_hashed_per_decision():
    lines = [json.dumps(line, sort_keys=True, separators=(",", ":")) + "\n" for line in HASHED]
    assert digest(*EVENTS) == hashlib.sha256("".join(lines).encode()).hexdigest()[:16]


def test_the_journal_gives_the_same_trace():
    trace = Trace()
    for event in EVENTS:
        trace.take(json.loads(json.dumps(entry_of(event))))
    assert trace.hexdigest() == digest(*EVENTS)


def test_wording_and_noise_below_a_micrometre_do_not_count():
    other = {**STATUS, "message": "no seal 0.1 s after contact", "outputs": {"p": [0.1 + 1e-9, 0.2]}}
    assert digest(Event("status", 3, 0.1, STATUS)) == digest(Event("status", 3, 0.1, other))


@pytest.mark.parametrize("kind", ["run", "look", "intent", "request", "end"])
def test_events_that_decide_nothing_do_not_count(kind):
    assert digest(Event(kind, 3, 0.1, {"run": "/tmp/x", "item": "cube-1"})) == digest()
