"""The last lines on a terminal after runs that failed."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.record.result import MAX_LINE_WIDTH, format_diagnosis
from tests.record.failed_runs import PICK, FailedRun

CUBE = [("cube", 0.5, 0.1)]


def slip(run: FailedRun) -> None:
    seals = iter([False])
    run.fake.tool.can_hold = lambda: next(seals, True)
    run.slip()


def break_down(run: FailedRun) -> None:
    def raise_error() -> bool:
        raise ZeroDivisionError("vacuum gauge")

    run.fake.tool.can_hold = raise_error


def halt_with_load(run: FailedRun) -> None:
    run.at_every_step(
        lambda: run.run.control.stop() if run.fake.world.held_object and run.height > 0.1 else None
    )


def lose_object(run: FailedRun) -> None:
    run.slip(1, vanish=True)


def bar_the_way(run: FailedRun) -> None:
    def set_obstacle() -> None:
        run.fake.arm.next_obstacle = "link 5 met a wrench" if run.fake.world.held_object else None

    run.at_every_step(set_obstacle)


@pytest.mark.parametrize(
    ("mission", "prepare", "fragments"),
    [
        (PICK, slip, [
            "Transit of cube-1 failed (dropped) on the last of 3 attempts: the seal on cube-1 broke",
            "all 3 attempts failed: 1 x Grasp.missed, 2 x Transit.dropped (line 11)",
            "Transit of cube-1 tree/5:retry/do/Transit (line 15)",
            "frame 3, camera overhead, by embedded", "3 looks, 3 failed attempts in all",
            "the arm is at rest, the tool is empty left to do 1: cube-1",
            "in a new try around line 15, or allow more than 3 attempts at line 11",
            "record runs/latest repeat executive run trial",
        ]),
        (PICK, break_down, [
            "Grasp: ZeroDivisionError: vacuum gauge where tree/5:retry/do/Grasp (trial.yaml:15)",
            "in raise_error; the whole traceback",
            "1 look, 0 failed attempts in all", "a fault is never retried",
            "resume executive run --resume runs/latest",
        ]),
        ("sort_overhead", halt_with_load, [
            "halted by the user during Transit of cube-1 and Wait", "the tool holds cube-1",
            "to resume this run, leave cube-1 in the tool",
        ]),
        ("sort_overhead", lose_object, [
            "1 object was lost: cube-1 lost cube-1 last detected at (0.500, 0.100, 0.025) m at 0.05 s",
            "not detected in the 2 later looks; Transit.dropped at", "look for cube-1 by hand",
        ]),
        ("sort_overhead", bar_the_way, [
            "PutDown of cube-1 failed (blocked): link 5 met a wrench",
            "repeat this failure is not in until (choice.no_candidate)",
            "carry_and_watch: try caught Transit.blocked (link 5 met a wrench), but the handler failed",
            "put_off: try catches only PutDown.dropped",
            "catch this failure in the try at",
        ]),
    ],
    ids=["slip", "fault", "halt", "lost", "blocked"],
)  # fmt: skip
def test_a_failed_run_is_explained(
    mission: str, prepare: Callable[[FailedRun], None], fragments: list[str], tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = FailedRun(mission, objects=CUBE)
    prepare(run)
    lines = format_diagnosis(run.tell(), "runs/latest", "executive run trial")
    assert max(map(len, lines)) <= MAX_LINE_WIDTH
    text = " ".join(" ".join(lines).split())
    assert [fragment for fragment in fragments if fragment not in text] == []
