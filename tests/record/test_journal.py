"""The journal and its reader."""

from __future__ import annotations

import json
import os
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.errors import Fault, InputError
from executive.events import Event
from executive.record.entry import TRANSIENT
from executive.record.journal import Journal, read_journal
from executive.record.plain import plain


@pytest.fixture
def syncs(monkeypatch):
    """The sizes of the file at every fsync."""
    sizes = []
    monkeypatch.setattr(os, "fsync", lambda file: sizes.append(os.fstat(file).st_size))
    return sizes


def test_writes_an_object_per_line_with_its_stamp_first(tmp_path):
    journal = Journal(tmp_path / "journal.jsonl")
    journal(Event("status", 3, 0.0125, {"node": "a/Grasp", "at": np.array([1 / 3])}))
    text = (tmp_path / "journal.jsonl").read_text()
    journal.close()
    assert text == '{"tick": 3, "clock": 0.0125, "kind": "status", "node": "a/Grasp", "at": [0.333333]}\n'


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.just(np.array([1 / 3, np.nan])),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner)
        | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=6,
)
KEYS = st.sampled_from(["node", "status", "outputs", "größe", 'a "key"', "tick", "clock", "kind", *TRANSIENT])


@settings(deadline=None)
@given(
    st.builds(
        Event, st.sampled_from(["status", "item", "end"]), st.integers(0), st.floats(0),
        st.dictionaries(KEYS, VALUES),
    )
)  # fmt: skip
def test_every_line_is_the_json_of_the_stamp_and_of_the_data_made_plain(event):
    stamp = {"tick": event.tick, "clock": plain(event.clock), "kind": event.kind}
    data = {key: value for key, value in event.data.items() if key not in (*TRANSIENT, *stamp)}
    line = json.dumps({**stamp, **plain(data)}, ensure_ascii=False, allow_nan=False) + "\n"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "journal.jsonl"
        with closing(Journal(path)) as journal:
            journal(event)
        assert path.read_bytes() == line.encode()


def test_leaves_the_pixels_out(tmp_path):
    journal = Journal(tmp_path / "journal.jsonl")
    journal(Event("look", 0, 0.0, {"frame": 1, "frame_object": object()}))
    journal.close()
    assert list(read_journal(tmp_path / "journal.jsonl")[0]) == ["tick", "clock", "kind", "frame"]


def test_data_cannot_overwrite_the_stamp(tmp_path):
    journal = Journal(tmp_path / "journal.jsonl")
    journal(Event("item", 5, 1.0, {"tick": 9, "kind": "other"}))
    journal.close()
    assert read_journal(tmp_path / "journal.jsonl") == [{"tick": 5, "clock": 1.0, "kind": "item"}]


@pytest.mark.parametrize(
    ("event", "synced"),
    [
        (Event("intent", 1, 0.0, {"action": "close"}), True),
        (Event("item", 1, 0.0, {"state": "placed"}), True),
        (Event("item", 1, 0.0, {"state": "held"}), False),
        (Event("status", 1, 0.0, {}), False),
    ],
)
def test_intents_and_placements_are_on_the_disk_at_once(tmp_path, syncs, event, synced):
    journal = Journal(tmp_path / "journal.jsonl")
    journal(event)
    assert syncs == ([(tmp_path / "journal.jsonl").stat().st_size] if synced else [])
    journal.close()


def test_a_full_disk_is_one_fault_and_then_silence(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "journal.jsonl")

    def full(file, line):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(Fault, match=r"cannot be written: no space left on device; the run stops"):
        journal(Event("status", 0, 0.0, {}))
    journal(Event("end", 1, 0.0, {}))
    journal.close()


def test_a_line_the_disk_takes_in_parts_is_whole(tmp_path, monkeypatch):
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, line: write(file, line[:5]))
    journal = Journal(tmp_path / "journal.jsonl")
    journal(Event("end", 1, 0.0, {"status": "SUCCESS"}))
    journal.close()
    assert read_journal(tmp_path / "journal.jsonl")[0]["status"] == "SUCCESS"


def test_closing_twice_is_harmless(tmp_path):
    journal = Journal(tmp_path / "journal.jsonl")
    journal.close()
    journal.close()
    journal(Event("end", 1, 0.0, {}))
    assert (tmp_path / "journal.jsonl").read_text() == ""


@pytest.mark.parametrize("torn", range(1, 20, 3))
def test_a_torn_last_line_is_left_out(tmp_path, torn):
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b'{"tick": 1}\n' + b'{"tick": 2, "a": "\xc3\xa4"}\n'[:torn])
    assert read_journal(path) == [{"tick": 1}]


def test_a_broken_line_in_the_middle_is_an_error_with_its_number(tmp_path):
    path = tmp_path / "journal.jsonl"
    path.write_text('{"tick": 1}\n{"tick"\n{"tick": 3}\n')
    with pytest.raises(InputError, match=r"journal\.jsonl:2: this line is not JSON"):
        read_journal(path)


def test_a_missing_journal_is_a_sentence(tmp_path):
    with pytest.raises(InputError, match=r"cannot read the journal .* no such file"):
        read_journal(tmp_path / "journal.jsonl")


def test_what_is_read_is_what_was_written(tmp_path):
    journal = Journal(tmp_path / "journal.jsonl")
    events = [Event("status", tick, tick / 240, {"message": f'"{tick}"\nß'}) for tick in range(50)]
    for event in events:
        journal(event)
    journal.close()
    entries = read_journal(tmp_path / "journal.jsonl")
    assert [entry["message"] for entry in entries] == [event.data["message"] for event in events]
    assert json.dumps(entries)
