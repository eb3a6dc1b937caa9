"""The hash over every decision of a run."""

from __future__ import annotations

import hashlib
import json
from contextlib import closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.events import Event
from executive.record.journal import Journal, read_journal
from executive.record.plain import plain
from executive.record.trace import Trace

STATUS = {
    "node": "sort/Grasp",
    "status": "FAILURE",
    "reason": "missed",
    "message": "no seal",
    "item": "cube-1",
    "outputs": {"p": np.array([0.1, 0.2])},
}


def digest(*events: Event) -> str:
    trace = Trace()
    for event in events:
        trace(event)
    return trace.hexdigest()


def test_is_sixteen_hexadecimal_digits():
    assert len(digest()) == 16
    assert int(digest(), 16) >= 0


def test_equal_events_give_equal_traces():
    assert digest(Event("status", 3, 0.1, STATUS)) == digest(Event("status", 3, 0.1, dict(STATUS)))


@pytest.mark.parametrize(
    "change",
    [
        {"node": "sort/Other"},
        {"status": "SUCCESS"},
        {"reason": "other"},
        {"item": "cube-2"},
        {"outputs": {"p": np.array([0.1, 0.20001])}},
    ],
)
def test_every_decision_counts(change):
    assert digest(Event("status", 3, 0.1, STATUS)) != digest(Event("status", 3, 0.1, {**STATUS, **change}))


HASHED = {
    "status": ("node", "status", "reason", "item", "outputs"),
    "item": ("item", "state", "label", "position", "bin"),
    "decision": ("item", "label", "frame"),
}
KEYS = sorted({"message", "tick", "kind", *(key for keys in HASHED.values() for key in keys)})
DATA = st.dictionaries(
    st.sampled_from(KEYS),
    st.none()
    | st.integers()
    | st.text()
    | st.dictionaries(st.text(max_size=3), st.floats() | st.just(np.array([0.1, np.inf])), max_size=4),
)


@settings(deadline=None)
@given(st.lists(st.builds(Event, st.sampled_from([*HASHED, "end"]), st.integers(0), st.floats(0), DATA)))
def test_hashes_one_line_of_compact_json_per_decision(events):
    lines = [
        json.dumps(
            [event.tick, event.kind, *(plain(event.data.get(key)) for key in HASHED[event.kind])],
            sort_keys=True,
            separators=(",", ":"),
        )
        for event in events
        if event.kind in HASHED
    ]
    text = "".join(f"{line}\n" for line in lines)
    assert digest(*events) == hashlib.sha256(text.encode()).hexdigest()[:16]


def test_can_be_told_from_the_journal(tmp_path):
    events = [
        Event("status", 3, 0.1, STATUS),
        Event("look", 4, 0.2, {"frame": 1}),
        Event("decision", 5, 0.3, {"item": "größe-1", "label": "cube", "frame": 1}),
        Event(
            "item", 6, 0.4, {"item": "cube-1", "state": "held", "position": np.array([1 / 3, -0.0, np.nan])}
        ),
    ]
    with closing(Journal(tmp_path / "journal.jsonl")) as journal:
        for event in events:
            journal(event)
    told = Trace()
    for entry in read_journal(tmp_path / "journal.jsonl"):
        told.take(entry)
    assert told.hexdigest() == digest(*events)


def test_the_tick_and_the_order_count():
    first, second = Event("status", 3, 0.1, STATUS), Event("status", 4, 0.1, STATUS)
    assert digest(first) != digest(second)
    assert digest(first, second) != digest(second, first)


def test_wording_and_noise_below_a_micrometre_do_not_count():
    other = {**STATUS, "message": "no seal 0.1 s after contact", "outputs": {"p": [0.1 + 1e-9, 0.2]}}
    assert digest(Event("status", 3, 0.1, STATUS)) == digest(Event("status", 3, 0.1, other))


@pytest.mark.parametrize("kind", ["run", "look", "intent", "request", "end"])
def test_what_decides_nothing_does_not_count(kind):
    assert digest(Event(kind, 3, 0.1, {"run": "/tmp/x", "item": "cube-1"})) == digest()


def test_what_becomes_of_items_and_what_is_chosen_count():
    placed = {"item": "cube-1", "state": "placed", "bin": "red_bin", "label": "cube", "position": (0, 0, 0)}
    assert digest(Event("item", 1, 0.0, placed)) != digest(
        Event("item", 1, 0.0, {**placed, "bin": "blue_bin"})
    )
    chosen = {"item": "cube-1", "label": "cube", "frame": 1}
    other = {**chosen, "item": "cube-2"}
    assert digest(Event("decision", 1, 0.0, chosen)) != digest(Event("decision", 1, 0.0, other))
