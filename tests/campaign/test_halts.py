"""Halting a mission all over its run: every shipped mission stands it, and what does not is found."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from executive.campaign.halts import Undisturbed, halt_everywhere, rehearse, spread_ticks
from executive.campaign.subject import Subject
from executive.discovery import discover
from executive.errors import ExecutiveError
from executive.mission.load import load_mission
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import oracle_cell
from executive.workcell import Workcell

MISSIONS = sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))


def subject(path: Path, kind: Callable[..., Workcell] = FakeCell, seed: int = 1) -> Subject:
    return Subject(load_mission(path, discover()), discover(), kind, "fake", seed)


@pytest.fixture
def sort(missions: Path) -> Path:
    return missions / "sort_overhead.yaml"


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_halted_anywhere_on_the_fake_cell_it_leaves_everything_in_order(path: Path) -> None:
    figures = halt_everywhere(subject(path), every=1, points=50, followed=1)
    assert figures.failed == ()
    assert (len(figures.halts), figures.complete) == (50, True)
    assert sum(halt.followed for halt in figures.halts) == 1
    assert sum(halt.moving for halt in figures.halts) >= 20
    assert any(halt.holds for halt in figures.halts)


@pytest.mark.parametrize("name", ["sort_overhead", "sort_wrist"])
def test_halted_anywhere_in_the_simulated_world_the_arm_brakes_as_it_may(missions: Path, name: str) -> None:
    figures = halt_everywhere(
        subject(missions / f"{name}.yaml", oracle_cell()), every=1, points=50, followed=1
    )
    assert figures.failed == ()
    assert len(figures.halts) == 50
    moving = [halt for halt in figures.halts if halt.moving]
    assert len(moving) >= 30
    assert all(halt.deviation is not None for halt in moving)
    # Were nothing measured, nothing would take its time, or be near its limit.
    assert max(halt.rest for halt in moving) > 0.1
    assert max(halt.jerk or 0.0 for halt in moving) > 0.5


def test_the_moments_are_evenly_spread_over_the_run() -> None:
    assert list(spread_ticks(10, 3)) == [0, 3, 6, 9]
    assert spread_ticks(101, 1, 5) == [0, 25, 50, 75, 100]
    assert spread_ticks(3, 1, 50) == [0, 1, 2]


def test_progress_is_told_after_every_halt(sort: Path) -> None:
    told: list[tuple[int, int]] = []
    halt_everywhere(
        subject(sort), every=1, points=3, followed=0, progress=lambda done, all: told.append((done, all))
    )
    assert told == [(1, 3), (2, 3), (3, 3)]


def interrupt(*progress: int) -> None:
    """Press Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture
def sigint() -> Iterator[None]:
    """Hear SIGINT: what a shell runs in the background begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("sigint")
def test_after_ctrl_c_no_further_halt_is_tried_and_those_so_far_are_kept(sort: Path) -> None:
    figures = halt_everywhere(subject(sort), every=1, points=9, followed=0, progress=interrupt)
    assert (len(figures.halts), figures.wanted, figures.complete) == (1, 9, False)
    assert figures.failed == ()


@pytest.mark.usefixtures("sigint")
def test_ctrl_c_before_the_first_halt_ends_the_campaign(sort: Path) -> None:
    class Interrupted(FakeCell):
        def advance(self) -> None:
            super().advance()
            interrupt()

    with pytest.raises(KeyboardInterrupt):
        halt_everywhere(subject(sort, Interrupted), every=1)


def test_a_mission_that_does_not_succeed_is_no_subject(sort: Path) -> None:
    class Blind(FakeCell):
        def __init__(self, *given: Any, **options: Any) -> None:
            super().__init__(*given, **options)
            self.detector.answers = lambda look, true: "the server is gone"

    with pytest.raises(ExecutiveError, match=r"sort_overhead ended as FAILURE Detect.unavailable \(detector"):
        rehearse(subject(sort, Blind))


class Coasting(FakeCell):
    """A cell whose arm does not stop before its motion is over."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self.arm.stop = lambda: None  # type: ignore[method-assign]


def test_an_arm_that_does_not_brake_is_found(sort: Path) -> None:
    figures = halt_everywhere(subject(sort, Coasting), every=1, points=12, followed=0)
    problems = [problem for halt in figures.failed for problem in halt.problems]
    assert problems
    assert all(" s to rest; 0.5 is allowed" in problem for problem in problems)


class Mortal(FakeCell):
    """A cell that takes every process down but the first."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._home = os.getpid()

    def advance(self) -> None:
        """Let one control step pass, at home."""
        if os.getpid() != self._home:
            os.kill(os.getpid(), signal.SIGKILL)
        super().advance()


def test_a_halt_that_takes_its_process_down_is_one_that_went_wrong(sort: Path) -> None:
    figures = halt_everywhere(subject(sort, Mortal), every=1, points=3, followed=0)
    assert [halt.problems for halt in figures.halts] == [
        ("its process ended with the signal SIGKILL and told nothing",)
    ] * 3


class Grudging(FakeCell):
    """A cell that has no time to lose in a process that is not the first."""

    home = os.getpid()

    def audit(self) -> dict[str, int]:
        """Return what became of the objects, at home."""
        if os.getpid() != self.home:
            raise ZeroDivisionError("no audit here")
        return super().audit()


def test_an_error_while_a_halt_is_looked_at_is_told_with_its_traceback(sort: Path) -> None:
    (halt,) = halt_everywhere(subject(sort, Grudging), every=1, points=1, followed=0).halts
    (problem,) = halt.problems
    assert problem.startswith("Traceback")
    assert problem.rstrip().endswith("ZeroDivisionError: no audit here")


class Forgetful(FakeCell):
    """A cell that from its second run on in one process has another object on its table."""

    made: int

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        Forgetful.made += 1
        # The rehearsal, and the run that is halted.
        if Forgetful.made > 2:
            self.world.objects.pop()


def test_a_next_run_that_goes_otherwise_is_found(sort: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Forgetful, "made", 0, raising=False)
    (halt,) = halt_everywhere(subject(sort, Forgetful), every=1, points=1, followed=1).halts
    assert halt.followed
    (problem,) = halt.problems
    assert problem.startswith("the next run in the same process took ")
    assert isinstance(rehearse(subject(sort)), Undisturbed)
