"""What the journal costs a run: that everything it does is measured, and what is made of the figures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from executive.campaign import journal_cost
from executive.campaign.journal_cost import JournalCost, TimedJournal, measure
from executive.discovery import discover
from executive.errors import InputError
from executive.events import Event
from executive.mission.load import LoadedMission, load_mission
from executive.record.journal import read_journal
from executive.runtime.cells import cell_kind

COST = JournalCost(
    entries=793, size=160_534, syncs=19, encode=0.01, write=0.02, sync=0.0575, append=0.1, record=0.125,
    wall=10.0,
)  # fmt: skip


@pytest.fixture
def one_object(missions: Path) -> LoadedMission:
    overrides = {"cell.kind": "fake", "cell.table.objects": "[1, 1]"}
    return load_mission(missions / "sort_overhead.yaml", discover(), overrides, cell_kind)


def test_every_line_and_every_wait_of_a_run_is_counted(one_object, tmp_path, monkeypatch):
    syncs, lines = [], []
    write, fsync = os.write, os.fsync
    monkeypatch.setattr(os, "write", lambda file, line: lines.append(line) or write(file, line))
    monkeypatch.setattr(os, "fsync", lambda file: syncs.append(file) or fsync(file))
    cost = measure(one_object, discover(), seed=5, runs=tmp_path / "runs")
    written = [line for line in lines if line.startswith(b'{"tick"')]
    assert (cost.entries, cost.size, cost.syncs) == (len(written), sum(map(len, written)), len(syncs))
    assert cost.syncs >= 4
    assert 0 < cost.encode + cost.write + cost.sync <= cost.append <= cost.record <= cost.wall


def test_nothing_is_left_of_the_measured_run(one_object, tmp_path):
    measure(one_object, discover(), seed=5, runs=tmp_path / "runs")
    assert list((tmp_path / "runs").iterdir()) == []


def test_a_place_that_cannot_be_written_to_is_a_sentence(one_object, tmp_path):
    (tmp_path / "runs").write_text("a file, no folder")
    with pytest.raises(InputError, match=r'cannot record a run below ".*runs": file exists; .* --runs DIR'):
        measure(one_object, discover(), seed=5, runs=tmp_path / "runs")


def test_a_journal_that_measures_itself_writes_what_any_other_does(tmp_path, monkeypatch):
    clock = iter(range(100))
    monkeypatch.setattr(journal_cost.time, "perf_counter", lambda: next(clock))
    journal = TimedJournal(tmp_path / "journal.jsonl")
    journal(Event("status", 0, 0.0, {}))
    journal(Event("intent", 1, 0.0, {}))
    # Every question to the clock is a second: two of its own, two for each part that lies inside.
    assert (journal.encode, journal.write, journal.sync, journal.append_time) == (2, 2, 1, 5 + 7)
    journal.close()
    assert [entry["kind"] for entry in read_journal(tmp_path / "journal.jsonl")] == ["status", "intent"]


def test_the_figures_are_told_in_seconds_and_percent_of_the_run():
    assert COST.share == 0.01
    assert COST.as_plain() == {
        "entries": 793, "bytes": 160_534, "syncs": 19, "encode_s": 0.01, "write_s": 0.02, "sync_s": 0.0575,
        "append_s": 0.1, "record_s": 0.125, "wall_s": 10.0, "percent": 1.0, "most_percent": 3.0,
    }  # fmt: skip
    head, _, *rows = COST.text().splitlines()
    assert head == "793 lines, 160.5 kB, 19 times on the disk at once; the journal may cost 3% of the run"
    assert [row.split() for row in rows] == [
        ["encode", "10.0", "0.10"],
        ["write", "20.0", "0.20"],
        ["sync", "57.5", "0.57"],
        ["journal", "100.0", "1.00"],
        ["record", "125.0", "1.25"],
        ["run", "10000.0", "100.00"],
    ]
