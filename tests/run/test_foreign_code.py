"""Odd skills, behaviours, control nodes and detectors: the arm rests, the record is closed, the code is 3."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import odd_parts
import pytest

from executive.behaviours import load_skills
from executive.events import RunEnded
from executive.mission.load import load_mission
from executive.record.journal import read_journal
from executive.record.recorded_run import record_run
from executive.record.replayed_run import replay_run
from executive.record.result import Result, find_exit_code
from executive.run import operator
from executive.run.assembly import RunOptions
from executive.testing.fake_cell import FakeCell
from executive.view.report import write_report

PROJECT = """\
[project]
name = "odd"
[project.entry-points."executive.skills"]
OddSkill = "odd_parts:OddSkill"
OddBehaviour = "odd_parts:OddBehaviour"
[project.entry-points."executive.control_nodes"]
odd = "odd_parts:OddNode"
"""
HALTED_SKILL = "timeout: {seconds: 0.3, do: OddSkill}"
NODES = {
    "start": "OddSkill", "moving": "OddSkill", "finally": HALTED_SKILL, "end": "OddSkill",
    "setup": "OddBehaviour", "initialise": "OddBehaviour", "update": "OddBehaviour",
    "terminate": "timeout: {seconds: 0.1, do: OddBehaviour}",
    "shutdown": "timeout: {seconds: 0.1, do: OddBehaviour}",
    "node start": "odd: OddSkill", "step": "odd: OddSkill", "clean up": "odd: OddSkill",
    "search": "Detect", "search in thread": "Detect",
}  # fmt: skip
"""Node of a mission in which a place of odd code is reached."""
PLACES = [place for place in NODES if place != "end"]
ENDS = [(place, effect) for place, effect in product(PLACES, odd_parts.EFFECTS) if "loop" not in effect]
ENDS.remove(("finally", "close"))  # A generator that is closed may raise GeneratorExit.
LOOPS = [(place, effect) for place in PLACES for effect in ("loop", "stubborn loop") if "thread" not in place]
RunWith = Callable[..., Result]


@pytest.fixture
def run_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunWith:
    """Record a run whose code does something odd at a place; check the arm, the record and its replay."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(operator, "MAX_TICK_TIME", 0.2)
    monkeypatch.setattr(operator, "MAX_HALT_TIME", 0.1)
    monkeypatch.setattr(operator, "TICK_CHECK_PERIOD", 0.05)
    (tmp_path / "pyproject.toml").write_text(PROJECT)
    mission = tmp_path / "tried.yaml"
    cells: list[FakeCell] = []

    def make_cell(*arguments: Any, **options: Any) -> FakeCell:
        cells.append(FakeCell(*arguments, **options))
        if place.startswith("search"):
            cells[0].detector.make_answer = lambda *_: odd_parts.act(place)  # type: ignore[assignment, return-value]
        return cells[0]

    place = ""

    def run(at: str, effect: Callable[..., object]) -> Result:
        nonlocal place
        place = at
        mission.write_text(f"mission: tried\ncell: cells/overhead.yaml\ntree:\n  - {NODES[at]}\n")
        monkeypatch.setitem(odd_parts.chosen, at, effect)
        loaded = load_mission(mission, load_skills())
        result = record_run(loaded, RunOptions(0, make_cell=make_cell), tmp_path / "runs")
        assert cells[0].arm.at_rest
        path = Path(result.run)
        events = list(read_journal(path / "journal.jsonl"))
        assert isinstance(events[-1].event, RunEnded)
        assert replay_run(path, events, load_skills()).is_equal
        assert write_report(path).is_file()
        return result

    return run


def check_fault(result: Result) -> None:
    assert (result.status, find_exit_code(result)) == ("FAULT", 3)
    assert result.message


@pytest.mark.parametrize(("place", "effect"), list(zip(PLACES, reversed(odd_parts.EFFECTS), strict=False)))
def test_whatever_foreign_code_raises_is_a_fault(place: str, effect: str, run_with: RunWith) -> None:
    check_fault(run_with(place, odd_parts.EFFECTS[effect]))


def test_the_diagnosis_names_the_line_of_an_endless_loop(run_with: RunWith) -> None:
    diagnosis = run_with("moving", odd_parts.EFFECTS["loop"]).diagnosis
    assert diagnosis is not None
    assert "odd_parts.py" in diagnosis.raised_at


@pytest.mark.slow
@pytest.mark.parametrize(("place", "effect"), ENDS + LOOPS)
def test_every_odd_end_at_every_place_is_a_fault(place: str, effect: str, run_with: RunWith) -> None:
    check_fault(run_with(place, odd_parts.EFFECTS[effect]))


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (0.31, "0.31"),
        (odd_parts.Silent(), "a Silent without text"),
        ("far " * 2_500_000, "far far"),
        (b"\xff", "b'\\xff'"),
    ],
)
def test_a_message_of_another_type_becomes_its_text(message: object, text: str, run_with: RunWith) -> None:
    result = run_with("end", lambda skill: odd_parts.throw(skill.failure("odd", message)))
    assert (result.status, result.reason) == ("FAILURE", "OddSkill.odd"), result.message[:300]
    assert result.message.startswith(text)
    assert len(result.message) <= 10_000
