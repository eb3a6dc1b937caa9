"""Many runs in one process leave nothing behind, and what does is found."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.campaign import soak as soaking
from executive.campaign.soak import sample, soak
from executive.campaign.subject import Subject
from executive.discovery import discover
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.testing.fake_cell import FakeCell
from executive.workcell import Workcell

RUNS = 12


@pytest.fixture(scope="module")
def subject(missions: Path) -> Callable[[Callable[..., Workcell]], Subject]:
    """A function that returns a sort of two objects in a kind of cell."""
    overrides = {"cell.table.objects": "[2, 2]"}
    loaded = load_mission(missions / "sort_overhead.yaml", discover(), overrides)
    return lambda kind: Subject(loaded, discover(), kind, "fake", 7)


def test_a_dozen_runs_leave_no_thread_no_handle_and_no_object(subject) -> None:
    told: list[tuple[int, int]] = []
    figures = soak(subject(FakeCell), RUNS, frames=False, progress=lambda done, all: told.append((done, all)))
    assert (len(figures.samples), figures.failed, figures.complete) == (RUNS, (), True)
    assert figures.samples[-1].threads <= figures.warm.threads
    assert figures.samples[-1].handles <= figures.warm.handles
    # One is the sample itself.
    assert figures.left_behind <= 1.5
    assert told == [(done, RUNS) for done in range(1, RUNS + 1)]


class Leaking(FakeCell):
    """A cell that never gives back a file, a thread and some objects."""

    kept: list[Any]

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        woken = threading.Event()
        thread = threading.Thread(target=woken.wait, daemon=True)
        thread.start()
        self.kept.append((os.open(os.devnull, os.O_RDONLY), thread, woken, [[] for _ in range(10)]))


def test_what_a_run_leaves_behind_is_found(subject, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Leaking, "kept", [], raising=False)
    try:
        figures = soak(subject(Leaking), RUNS, frames=False)
    finally:
        for handle, thread, woken, _ in Leaking.kept:
            os.close(handle)
            woken.set()
            thread.join()
    grown = RUNS - 5
    assert figures.samples[-1].handles - figures.warm.handles == grown
    assert figures.samples[-1].threads - figures.warm.threads == grown
    assert figures.left_behind > 10
    handles = figures.warm.handles
    assert f"{handles + grown} open files after the last run, {handles} after run 5" in figures.problems


class Lying(FakeCell):
    """A cell whose audit finds one object less in its bin."""

    def audit(self) -> dict[str, int]:
        """Return what became of the objects, all but one."""
        counts = super().audit()
        return {**counts, "right": counts["right"] - 1}


def test_a_run_whose_books_are_wrong_has_failed(subject) -> None:
    figures = soak(subject(Lying), 2, frames=False)
    assert [seed for seed, _ in figures.failed] == [7, 8]
    assert figures.failed[0][1].startswith("the ledger says {'seen': 2, 'placed': 2")


def test_a_run_that_fails_is_told_with_its_verdict(subject) -> None:
    class Blind(FakeCell):
        def __init__(self, *given: Any, **options: Any) -> None:
            super().__init__(*given, **options)
            self.detector.answers = lambda look, true: "the server is gone"

    figures = soak(subject(Blind), 1, frames=False)
    ((seed, verdict),) = figures.failed
    assert seed == 7
    assert verdict.startswith("FAILURE Detect.unavailable at ")


def test_runs_that_the_user_ends_are_not_counted(subject, monkeypatch: pytest.MonkeyPatch) -> None:
    results = iter(["SUCCESS", "HALTED"])

    def recorded_run(*given: Any, runs: Path, seed: int, **options: Any) -> dict[str, Any]:
        (runs / str(seed)).mkdir()
        return {"status": next(results), "items": {}, "audit": None, "run": str(runs / str(seed))}

    monkeypatch.setattr(soaking, "recorded_run", recorded_run)
    figures = soak(subject(FakeCell), 5)
    assert (len(figures.samples), figures.complete) == (1, False)


def test_a_sample_counts_this_process() -> None:
    before = sample()
    handle = os.open(os.devnull, os.O_RDONLY)
    try:
        assert sample().handles == before.handles + 1
    finally:
        os.close(handle)
    assert before.threads >= 1
    assert before.memory > 20.0
    assert before.objects > 10_000


def test_a_system_that_does_not_tell_is_no_place_to_soak(
    subject, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(soaking, "PROCESS", tmp_path / "gone")
    with pytest.raises(InputError, match="which only Linux has; soak there"):
        soak(subject(FakeCell), 1)
