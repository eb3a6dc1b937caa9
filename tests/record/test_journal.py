"""The journal and its reader."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import reduce

import numpy as np
import pytest
from pydantic_core import from_json

from executive.errors import Fault, InputError
from executive.events import Event, Exact
from executive.record.entry import entry_of
from executive.record.journal import Journal, ending_of, read_journal


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal.jsonl"


@pytest.fixture
def syncs(monkeypatch):
    """The sizes of the file at every fsync."""
    sizes = []
    monkeypatch.setattr(os, "fsync", lambda file: sizes.append(os.fstat(file).st_size))
    return sizes


def write(path, *events, again=False):
    with closing(Journal(path, again=again)) as journal:
        for event in events:
            journal(event)


def test_writes_an_object_per_line_with_its_stamp_first_and_no_pixels_and_nothing_once_it_is_closed(path):
    journal = Journal(path)
    data = {"node": "größe", "at": np.array([1 / 3]), "tick": 9, "kind": "other", "frame_object": object()}
    journal(Event("status", 3, 0.0125, data))
    journal.close()
    journal.close()
    journal(Event("end", 4, 0.0, {}))
    text = '{"tick": 3, "clock": 0.0125, "kind": "status", "node": "größe", "at": [0.333333]}\n'
    assert path.read_text() == text


class Shy(Mapping):
    """Raises whenever it is asked for what it holds."""

    def __iter__(self):
        raise RuntimeError

    __len__ = __getitem__ = __iter__


@dataclass
class Unfinished:
    value: object = field(init=False)


ENDLESS: list = [1]
ENDLESS.append(ENDLESS)
DEEP = reduce(lambda inner, number: [inner] if number % 2 else {"a": inner}, range(5000), 1)


@pytest.mark.parametrize(
    "value",
    [Shy(), Unfinished(), ENDLESS, DEEP, np.array([1, None], dtype=object), np.void(b"a"), "\ud800"],
    ids=lambda value: type(value).__name__,
)
def test_whatever_is_told_becomes_one_line_of_json_that_reads_back(path, value):
    event = Event("status", 0, 0.0, {"a": 1, "outputs": value})
    write(path, event)
    (line,) = path.read_bytes().splitlines()
    told = entry_of(event)
    # Python reads more than is JSON.
    assert read_journal(path) == [told] == [from_json(line, allow_inf_nan=False)]
    if isinstance(value, (Shy, Unfinished, list, dict)):
        assert told["outputs"] == type(value).__name__


@pytest.mark.parametrize(
    ("kind", "data", "synced"),
    [
        ("intent", {"action": "close"}, True),
        ("item", {"state": "placed"}, True),
        ("item", {"state": "held"}, False),
        ("status", {}, False),
        ("sense", {}, False),
        ("end", {}, True),
    ],
)
def test_intents_placements_and_the_end_are_on_the_disk_at_once(path, syncs, kind, data, synced):
    with closing(Journal(path)) as journal:
        journal(Event(kind, 1, 0.0, data))
        assert syncs == [path.stat().st_size] * synced


def full(*args):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("taken", [0, 1, 17])
@pytest.mark.parametrize("again", [False, True])
def test_a_full_disk_is_one_fault_then_silence_and_no_part_of_a_line(path, monkeypatch, again, taken):
    path.write_bytes(FIRST[:-1] * again)
    journal = Journal(path, again=again)
    journal(Event("status", 0, 0.0, {}))
    before = path.read_bytes()
    write, parts = os.write, iter([taken] * (taken > 0))
    monkeypatch.setattr(os, "write", lambda file, line: write(file, line[: next(parts, None) or full()]))
    with pytest.raises(Fault, match=r"cannot be written: no space left on device; the run stops"):
        journal(Event("status", 1, 0.0, {}))
    journal(Event("end", 1, 0.0, {}))
    journal.close()
    assert path.read_bytes() == before == FIRST * again + b'{"tick": 0, "clock": 0.0, "kind": "status"}\n'


def test_what_reaches_the_disk_only_at_the_close_is_not_believed_unseen(path, monkeypatch):
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Fault, match=r"may lack its last lines: no space left on device; believe"):
        write(path, Event("status", 0, 0.0, {}))


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("kind", ["intent", "end"])
def test_a_journal_deleted_meanwhile_is_a_fault_at_the_next_intent_or_the_end(tmp_path, kind, whole):
    directory = tmp_path / "run"
    directory.mkdir()
    journal = Journal(directory / "journal.jsonl")
    (directory / "journal.jsonl").unlink()
    if whole:
        directory.rmdir()
    journal(Event("status", 1, 0.0, {}))
    with pytest.raises(Fault, match="cannot be written: it was deleted while the run went on; the run stops"):
        journal(Event(kind, 2, 0.0, {}))
    journal.close()


def test_a_line_the_disk_takes_in_parts_is_whole(path, monkeypatch):
    take = os.write
    monkeypatch.setattr(os, "write", lambda file, line: take(file, line[:5]))
    write(path, Event("end", 1, 0.0, {"status": "SUCCESS"}))
    assert read_journal(path)[0]["status"] == "SUCCESS"


FIRST = b'{"tick": 1, "kind": "run"}\n'
LAST = '{"tick": 2, "kind": "ä"}'.encode()
ENDS = {
    b"": 0,
    FIRST: 1,
    FIRST + LAST: 2,
    FIRST + LAST + b"\n": 2,
    FIRST + LAST + b"\0\0\0": 2,
    FIRST + LAST + b"\n\0\0\0": 2,
    FIRST + b"\0": 1,
    b"\0" * 5000: 0,
    **{FIRST + LAST[:length]: 1 for length in range(1, len(LAST))},
    **{FIRST + LAST[:length] + b"\0" * 9: 1 for length in range(1, len(LAST))},
    LAST[:5]: 0,
}
"""What a kill or a power cut may leave, and how many entries that is."""


@pytest.mark.parametrize("content", ENDS)
def test_a_torn_end_is_left_out_and_cut_off_where_the_journal_goes_on(path, content):
    path.write_bytes(content)
    ticks = [1, 2][: ENDS[content]]
    assert [entry["tick"] for entry in read_journal(path)] == ticks
    write(path, Event("resume", 3, 0.0, {}), again=True)
    entries = [json.loads(line) for line in path.read_bytes().splitlines()]
    assert [entry["tick"] for entry in entries] == [*ticks, 3]
    assert read_journal(path) == entries


def test_a_torn_end_is_cut_on_the_disk_before_anything_is_appended(path, syncs):
    path.write_bytes(FIRST + LAST[:5])
    write(path, again=True)
    assert syncs == [len(FIRST)]


def test_a_new_run_needs_a_new_journal_and_one_that_goes_on_an_old_one(path):
    with pytest.raises(InputError, match=r"cannot read the journal .* no such file"):
        read_journal(path)
    with pytest.raises(InputError, match=r'cannot open the journal ".*": no such file or directory'):
        Journal(path, again=True)
    assert list(path.parent.iterdir()) == []
    path.write_bytes(FIRST)
    with pytest.raises(InputError, match="the record of another run; a new run needs a directory of its own"):
        Journal(path)
    assert path.read_bytes() == FIRST
    Journal(path, again=True).close()


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b'{"tick"', "Expecting"),
        (b"", "Expecting value"),
        (b"[1]", "it is no object"),
        (b"\0\0\0\0", "Expecting value"),
        (b'{"a": "\xc3"}', "can't decode"),
        (b"[" * 100_000, "nested too deeply"),
    ],
)
def test_a_broken_line_in_the_middle_is_an_error_with_its_number(path, line, why):
    path.write_bytes(FIRST + line + b"\n" + FIRST)
    with pytest.raises(InputError) as raised:
        read_journal(path)
    start, end = str(raised.value).split(why)
    assert start.startswith(f"{path}:2: this line is not JSON (")
    assert end.endswith(
        "it was changed after the run, or the disk lost a part of it; bring back a copy of it"
    )


@pytest.mark.parametrize(
    ("kinds", "ended"),
    [("", None), ("run status", None), ("run status end", 2), ("run end resume status", None),
     ("run end resume end", 3)],
)  # fmt: skip
def test_a_run_has_ended_where_nothing_comes_after_its_end(kinds, ended):
    entries = [{"tick": number, "kind": kind} for number, kind in enumerate(kinds.split())]
    assert ending_of(entries) == (None if ended is None else entries[ended])


def test_an_exact_value_comes_back_as_it_was(path):
    value = {"q": [0.1 + 0.2, -0.0, 5e-324], "text": "caf\udce9 ä\n", "off": None, "n": 2**70, "on": True}
    write(path, Event("sense", 0, 0.0, {"value": Exact(value)}))
    assert repr(read_journal(path)[0]["value"]) == repr(value)


@pytest.mark.parametrize("value", [float("nan"), {"a": [float("inf")]}, object(), b"", {1, 2}, {(1,): 2}])
def test_an_exact_value_that_is_not_json_is_a_fault_and_the_journal_goes_on(path, value):
    with closing(Journal(path)) as journal:
        with pytest.raises(Fault, match=r'no words for an event of kind "sense": .*; what is .* plain JSON'):
            journal(Event("sense", 0, 0.0, {"value": Exact(value)}))
        journal(Event("end", 1, 0.0, {}))
    assert [entry["kind"] for entry in read_journal(path)] == ["end"]
