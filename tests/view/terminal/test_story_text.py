"""The last lines on a terminal after runs that failed."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from executive.record.diagnosis.diagnosis import (
    MAX_LINE_WIDTH,
    DecidingNode,
    Diagnosis,
    FailureNode,
    format_diagnosis,
)
from executive.record.timeline.items import Sighting
from tests.record.failed_runs import PICK, FailedRun

CUBE = [("cube", 0.5, 0.1)]
TIMEOUT = "  timeout:\n    seconds: 1.0\n    do:\n" + "".join(f"    {line}\n" for line in PICK.splitlines())


def slip(run: FailedRun) -> None:
    seals = iter([False])
    run.fake.tool.can_seal = lambda: next(seals, True)
    run.slip()


def break_down(run: FailedRun) -> None:
    def raise_error() -> bool:
        raise ZeroDivisionError("vacuum gauge")

    run.fake.tool.can_seal = raise_error


def lose_server(run: FailedRun) -> None:
    run.fake.detector.make_answer = lambda look, true: "the server is gone"


def move_camera(run: FailedRun) -> None:
    run.fake.camera.describe_displacement = lambda frame: "camera overhead is not where the cell file says"


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
            "Transit of cube-1 tree/5:retry/do/Transit (line 15) readings tool.holding = False",
            "frame 3, camera overhead, by embedded", "3 looks, 3 failed attempts in all",
            "the arm is at rest, the tool is empty left to do 1: cube-1",
            "in a new try around line 15, or allow more than 3 attempts with --set attempts=",
            "record runs/latest repeat executive run trial",
        ]),
        (TIMEOUT, lambda run: None, [
            "timeout: the body did not end within 1 s during Transit of cube-1", "trial.yaml:7",
            "take cube-1 out of the tool before a new run", "or allow more than 1 s",
        ]),
        (PICK, break_down, [
            "Grasp: ZeroDivisionError: vacuum gauge where tree/5:retry/do/Grasp (trial.yaml:15)",
            "in raise_error; the whole traceback", "readings command raised ZeroDivisionError",
            "1 look, 0 failed attempts in all", "a fault is never retried",
            "resume executive run --resume runs/latest",
        ]),
        ("sort_overhead", lose_server, [
            "catches only Detect.unsure", "all 10 attempts failed: 10 x Detect.unavailable",
            "make sure that detector.embedded answers again", "or allow more than 10 attempts at ",
        ]),
        ("sort_overhead", move_camera, ["mount camera and bins as the cell file says"]),
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
            "put_off: try catches only PutDown.dropped", "readings arm.met = link 5 met a wrench",
            "find what the arm collided with", "catch this failure in the try at",
        ]),
    ],
    ids=["slip", "timeout", "fault", "unavailable", "moved", "halt", "lost", "blocked"],
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


STORY = Diagnosis(
    status="FAILURE", reason="Grasp.missed", clock=1.0, mission="trial.yaml", item="",
    verdict="Grasp failed (missed): no seal", passed_nodes=[], readings=[], last_look=None, lost_items=[],
    node=DecidingNode("tree/Grasp", "Grasp", "trial.yaml:7"), halted_skills=[], unsorted_items=[],
    arm_state="at rest", held_item="",
    raised_at="", picture="", advice=[], is_recorded=True, can_resume=False,
)  # fmt: skip


def test_long_texts_are_wrapped_and_cut_but_a_command_is_neither() -> None:
    names = [f"some_subtree_{index}: retry" for index in range(9)]
    chain = [FailureNode(name, name, "a.yaml:1", "w" + " why" * 99) for name in names]
    story = replace(
        STORY,
        verdict="Grasp failed: " + "no seal, " * 90,
        passed_nodes=[*chain, FailureNode("tree/Grasp", "Grasp", "trial.yaml:7", "")],
        last_look=Sighting(1, "c", "d", 1.0, "cube-1", 0, 1, "cube", 0.5, [0.1, 0.2, 0.3]),
        unsorted_items=[f"cube-{index}" for index in range(400)],
        advice=["do this " * 60],
        picture="frames/000001_cube-1_missed.jpg",
    )
    repeat = "executive run trial" + " --set a=b" * 30
    lines = format_diagnosis(story, "runs/latest", repeat, "report.html")
    assert lines[-2:] == ["report      report.html", f"repeat      {repeat}"]
    assert max(map(len, lines[:-1])) <= MAX_LINE_WIDTH
    assert lines[3] == "why no node in trial.yaml handled the failure, from the root down:"
    assert lines[4].startswith("  some_subtree_0: retry  w why")
    assert "picture     frames/000001_cube-1_missed.jpg" in lines


@pytest.mark.parametrize(
    ("arm", "holds", "said"),
    [
        ("at rest", "something", "is at rest, the tool holds an unknown object"),
        ("it was told to brake", "", ": it was told to brake, the tool is empty"),
    ],
)
def test_the_state_of_arm_and_tool_is_described(arm, holds, said) -> None:
    lines = format_diagnosis(replace(STORY, arm_state=arm, held_item=holds), "runs/latest", "executive run x")
    assert any(re.fullmatch(f"now         the arm ?{said}", line) for line in lines)
