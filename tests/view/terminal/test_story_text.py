"""The last lines on a terminal after runs that went wrong, whole."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from executive.record.diagnosis.diagnosis import DecidingNode, Diagnosis, FailureNode
from executive.record.diagnosis.diagnosis_text import MAX_LINE_WIDTH, format_diagnosis
from executive.record.timeline.items import Sighting
from tests.record.failed_runs import PICK, FailedRun

CUBE = [("cube", 0.5, 0.1)]
DUCK = [("duck", 0.4, -0.1)]


@pytest.fixture
def abroad(tmp_path, monkeypatch):
    """Missions of a test's own are written to a folder of their own."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def at_home(missions, monkeypatch):
    """Shipped missions are called as in the project's folder."""
    monkeypatch.chdir(missions.parent)


TAIL = "record      runs/latest\nrepeat      executive run trial\n"
GO_ON = "resume      executive run --resume runs/latest\n"


def text(run: FailedRun, *, numbered: bool = True, tail: str = TAIL) -> str:
    """Execute a run; return its story up to its tail, lines of code and shipped missions unnumbered."""
    text = "\n".join(format_diagnosis(run.tell(), "runs/latest", "executive run trial")) + "\n"
    assert text.endswith(tail)
    text = re.sub(r"py:\d+", "py:N", text.removesuffix(tail))
    return text if numbered else unnumbered(text)


def unnumbered(text: str) -> str:
    return re.sub(r"(\bline |\.yaml:)\d+", r"\1N", text)


def test_an_object_that_slips_out_of_the_cup_every_time(abroad) -> None:
    run = FailedRun(PICK, objects=CUBE)
    seals = iter([False])
    run.fake.tool.can_seal = lambda: next(seals, True)
    run.slip()
    assert (
        text(run)
        == """\
FAILURE after 2.14 s: Transit of cube-1 failed (dropped) on the last of 3 attempts: the seal on cube-1 broke
  on the way to red_bin, near (0.50, 0.10, 0.12) m
why no node in trial.yaml handled the failure, from the root down:
  retry              all 3 attempts failed: 1 x Grasp.missed, 2 x Transit.dropped (line 11)
  Transit of cube-1  tree/5:retry/do/Transit (line 15)
readings    tool.holding = False (2.14 s), tool.touching = True (1.94 s), tool.bears = 7.9 (1.38 s)
last look   cube-1 as cube 0.90 at (0.498, 0.102, 0.025) m: frame 3, camera overhead, by embedded, at 1.53 s;
            3 looks, 3 failed attempts in all
now         the arm is at rest, the tool is empty
left to do  1: cube-1
next        to let the mission continue after Transit.dropped: catch this failure in a new try around line 15,
            or allow more than 3 attempts with --set attempts=...
"""
    )


def test_a_time_that_is_over(abroad) -> None:
    body = "".join(f"    {line}\n" for line in PICK.splitlines())
    tree = "  timeout:\n    seconds: $patience\n    do:\n" + body
    story = FailedRun(tree, objects=CUBE, overrides={"patience": "1.0"}).tell()
    assert story.verdict == "timeout: the body did not end within 1 s during Transit of cube-1"
    assert (story.node.path, story.node.place) == ("tree/timeout", "trial.yaml:7")
    assert story.advice == [
        "take cube-1 out of the tool before a new run",
        "to let the mission continue after timeout.timeout: catch this failure in a new try "
        "around line 7, or allow more than 1 s with --set patience=...",
    ]


def test_an_exception_in_a_part(abroad) -> None:
    run = FailedRun(PICK, objects=CUBE)

    def broken() -> bool:
        raise ZeroDivisionError("vacuum gauge")

    run.fake.tool.can_seal = broken
    assert (
        text(run, tail=TAIL + GO_ON)
        == """\
FAULT after 0.63 s: Grasp: ZeroDivisionError: vacuum gauge
where       tree/5:retry/do/Grasp (trial.yaml:15)
raised at   terminal/test_story_text.py:N, in broken; the whole traceback is in the journal, event
            "FaultRaised"
readings    command raised ZeroDivisionError (0.63 s)
last look   cube-1 as cube 0.90 at (0.500, 0.100, 0.025) m: frame 1, camera overhead, by embedded, at 0.05 s;
            1 look, 0 failed attempts in all
now         the arm is at rest, the tool is empty
left to do  1: cube-1
next        repair the code or the cell: a fault is never retried
"""
    )


def test_a_detector_that_gives_no_answer(at_home) -> None:
    run = FailedRun("sort_overhead", objects=CUBE)
    run.fake.detector.make_answer = lambda look, true: "the server is gone"
    story = run.tell()
    chain = [link.explanation for link in story.passed_nodes if link.explanation]
    assert chain[0::2] == ["catches only Detect.unsure", "all 10 attempts failed: 10 x Detect.unavailable"]
    assert [unnumbered(each) for each in story.advice] == [
        "make sure that detector.embedded answers again",
        "to let the mission continue after Detect.unavailable: catch this failure in the try at "
        "missions/library/sorting.yaml:N, or allow more than 10 attempts at missions/library/sorting.yaml:N",
    ]


def test_a_camera_that_was_moved_is_mounted_again_and_its_failure_not_caught(at_home) -> None:
    run = FailedRun("sort_overhead", objects=CUBE)
    run.fake.camera.displacement_message = "camera overhead is not where the cell file says"
    story = run.tell()
    assert story.reason == "Detect.camera_moved"
    assert story.advice == ["mount camera and bins as the cell file says, or measure the pose again"]


def test_a_halt_while_something_hangs_on_the_tool(at_home) -> None:
    run = FailedRun("sort_overhead", objects=[*CUBE, *DUCK])
    run.at_every_step(
        lambda: run.run.control.stop() if run.fake.world.held_object and run.height > 0.1 else None
    )
    story = run.tell()
    assert (story.held_item, story.unsorted_items, story.can_resume) == ("cube-1", ["cube-1", "duck-1"], True)
    assert story.verdict == "halted by the user during Transit of cube-1 and Wait"
    assert story.advice == [
        "to resume this run, leave cube-1 in the tool; take cube-1 out of the tool before a new run"
    ]


def test_an_object_that_is_lost(at_home) -> None:
    run = FailedRun("sort_overhead", objects=CUBE)
    run.slip(1, vanish=True)
    assert (
        text(run, numbered=False)
        == """\
FAILURE after 0.94 s: 1 object was lost: cube-1
lost        cube-1 last detected at (0.500, 0.100, 0.025) m at 0.05 s, not detected in the 2 later looks;
            Transit.dropped at 0.82 s: the seal on cube-1 broke on the way to red_bin, near (0.50, 0.10,
            0.12) m
now         the arm is at rest, the tool is empty
next        look for cube-1 by hand, below the place where it was dropped
"""
    )


def test_an_arm_whose_way_is_barred_whenever_it_carries(at_home) -> None:
    run = FailedRun("sort_overhead", objects=CUBE)

    def bar_the_way() -> None:
        run.fake.arm.next_obstacle = "link 5 met a wrench" if run.fake.world.held_object else None

    run.at_every_step(bar_the_way)
    assert (
        text(run, numbered=False)
        == """\
FAILURE after 2.35 s: PutDown of cube-1 failed (blocked): link 5 met a wrench
why no node in missions/sort_overhead.yaml handled the failure, from the root down:
  repeat                this failure is not in until (choice.no_candidate) (line N)
  carry_and_watch: try  caught Transit.blocked (link 5 met a wrench), but the handler failed
                        (missions/library/sorting.yaml:N)
  put_off: try          catches only PutDown.dropped (missions/library/sorting.yaml:N)
  PutDown of cube-1     tree/2:repeat/do/carry_and_watch/try/catch/3/put_off/try/do/PutDown
                        (missions/library/sorting.yaml:N)
readings    arm.met = link 5 met a wrench (1.29 s), tool.bears = 7.9 (0.73 s), tool.holding = True (0.73 s)
last look   cube-1 as cube 0.90 at (0.500, 0.100, 0.025) m: frame 1, camera overhead, by embedded, at 0.05 s;
            1 look, 0 failed attempts in all
now         the arm is at rest, the tool holds cube-1
left to do  1: cube-1
next        take cube-1 out of the tool before a new run
next        find what the arm collided with: link 5 met a wrench
next        to let the mission continue after PutDown.blocked: catch this failure in the try at
            missions/library/sorting.yaml:N
"""
    )


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
    assert lines[-2] == "report      report.html"
    assert lines[-1] == f"repeat      {repeat}"
    assert max(map(len, lines[:-1])) <= MAX_LINE_WIDTH
    assert lines[3] == "why no node in trial.yaml handled the failure, from the root down, 4 nodes omitted:"
    assert lines[4].startswith("  some_subtree_4: retry  w why")
    assert "picture     frames/000001_cube-1_missed.jpg" in lines


@pytest.mark.parametrize(
    ("arm", "holds", "said"),
    [
        ("at rest", "", "is at rest, the tool is empty"),
        ("at rest", "cube-1", "is at rest, the tool holds cube-1"),
        ("at rest", "something", "is at rest, the tool holds an unknown object"),
        ("it was told to brake", "", ": it was told to brake, the tool is empty"),
    ],
)
def test_what_is_known_of_arm_and_tool_is_said_in_words(arm, holds, said) -> None:
    lines = format_diagnosis(
        replace(STORY, arm_state=arm, held_item=holds), "runs/latest", "executive run trial"
    )
    assert any(re.fullmatch(f"now         the arm ?{said}", line) for line in lines)
