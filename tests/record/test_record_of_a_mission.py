"""The record of a whole mission, run on the fake cell."""

from __future__ import annotations

import pytest

from executive.discovery import discover
from executive.mission.load import load_mission
from executive.record.journal import read_journal
from executive.record.recorded_run import recorded_run
from executive.record.result import ledger_agrees
from executive.testing.fake_cell import FakeCell


@pytest.fixture
def run(missions, tmp_path, monkeypatch):
    """Run the shipped mission once and return its result."""
    monkeypatch.setattr("executive.runtime.run.cell_kind", lambda name: FakeCell)
    skills = discover()

    def once(seed: int, frames: bool = False) -> dict:
        loaded = load_mission(missions / "sort_overhead.yaml", skills)
        return recorded_run(loaded, skills, seed=seed, runs=tmp_path, frames=frames)

    return once


def test_every_decision_has_a_picture_and_every_tool_action_an_intent(run, tmp_path):
    result = run(3, frames=True)
    assert ledger_agrees(result)
    entries = read_journal(tmp_path / "latest" / "journal.jsonl")
    decisions = [entry for entry in entries if entry["kind"] == "decision"]
    pictures = {path.name for path in (tmp_path / "latest" / "frames").iterdir()}
    assert pictures >= {f"{entry['tick']:06d}_{entry['item']}.jpg" for entry in decisions}
    assert len(decisions) == result["items"]["placed"]
    assert entries[0]["kind"] == "run"
    assert entries[-1]["kind"] == "end"
    assert "frame_object" not in (tmp_path / "latest" / "journal.jsonl").read_text()
