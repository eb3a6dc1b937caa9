"""Diagnoses of runs that went wrong."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from failed_runs import PICK, FailedRun

from executive.behaviours import load_skills

CUBE = [("cube", 0.5, 0.1)]


@pytest.fixture(autouse=True)
def somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_success_has_no_story() -> None:
    assert FailedRun("sort_overhead").tell() is None


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        ("  retry: {attempts: $attempts, do: IsHolding}\n",
         "retry: all 3 attempts failed: 3 x IsHolding.empty"),
        ("  retry: {attempts: 4, on: [grip.empty], do: {IsHolding: {}, as: grip}}\n",
         "retry: all 4 attempts failed: 4 x IsHolding.empty"),
        ("  - MoveToScan\n  - Detect\n  - Localize\n"
         "  - retry: {attempts: 4, on: [SelectTarget.unseen], do: [SelectTarget, IsHolding]}\n",
         "retry: runs again only after SelectTarget.unseen"),
        ("  retry: {attempts: 4, recover: {invert: succeed}, do: IsHolding}\n",
         "retry: gave up after attempt 1 of 4: its recovery failed with invert.inverted: succeed succeeded"),
        ("  try: {timeout: {seconds: 0.2, do: {Wait: {seconds: 0.1}}}}\n  finally: IsHolding\n",
         "try: finally failed"),
        ("  - MoveToScan\n  - try: [Detect, IsHolding]\n    catch: [{on: [Detect.hidden], do: succeed}]\n",
         "try: catches only Detect.hidden"),
        ("  try: IsHolding\n  catch: [{on: [IsHolding.empty], do: {invert: succeed}}]\n",
         "try: caught IsHolding.empty (the sensor detects no seal), but the handler failed"),
        ("  - MoveToScan\n  - repeat: {until: [Detect.hidden], do: [Detect, IsHolding]}\n",
         "repeat: this failure is not in until (Detect.hidden)"),
        ("  repeat: {times: 3, do: IsHolding}\n",
         "repeat: a failure ends the loop before its 3 iterations are complete"),
        ("  for_each: {each: label, in: [cube, duck], do: IsHolding}\n",
         "for_each: failed at element 1 of 2: cube"),
        ("  timeout: {seconds: 2, do: [{Wait: {seconds: 0.5}}, IsHolding]}\n",
         "timeout: handles no failures; 0.50 of 2 s had passed"),
        ("  fallback: [{invert: succeed}, IsHolding]\n",
         "fallback: all 2 choices failed; the earlier ones failed with invert.inverted (succeed succeeded)"),
        ("  guard: {holds: run.elapsed < 9, do: [{Wait: {seconds: 0.1}}, IsHolding]}\n",
         "guard: handles no failures of its body"),
        ("  parallel: [{Wait: {seconds: 0.1}}, IsHolding]\n", "parallel: needs all 2 branches"),
        ("  parallel:\n    wait_for: any\n    do: [[{Wait: {seconds: 0.1}}, {invert: succeed}], IsHolding]\n",
         "parallel: needs one of its 2 branches; also failed: invert.inverted"),
    ],
)  # fmt: skip
def test_every_control_node_says_why_it_did_not_stop_a_failure(tree: str, expected: str) -> None:
    chain = FailedRun(tree, objects=CUBE).tell().passed_nodes
    assert [f"{link.name}: {link.explanation}" for link in chain if link.explanation] == [expected]


def test_an_undeclared_reason_is_reported_at_the_line_of_its_skill() -> None:
    run = FailedRun(PICK, objects=CUBE)

    def seals() -> bool:
        raise load_skills()["MoveToScan"]().failure("tired", "no more")

    run.fake.tool.can_hold = seals
    story = run.tell()
    assert 'it failed with the undeclared reason "tired"' in story.verdict
    assert re.fullmatch(r"record/test_diagnosis\.py:\d+, in seals", story.raised_at)


@pytest.mark.parametrize(
    ("at_rest", "arm", "first"),
    [
        (lambda: True, "at rest", "repair the code or the cell"),
        (lambda: False, "it is not at rest after the command to brake",
         "keep away from the arm until you have seen it stand still: it"),
        (lambda: 1 / 0, "the state of the arm cannot be read (ZeroDivisionError: division by zero)",
         "keep away from the arm"),
    ],
)  # fmt: skip
def test_a_fault_says_where_it_was_raised_and_what_is_known_of_the_arm(at_rest, arm, first) -> None:
    run = FailedRun(PICK, objects=CUBE)

    def broken() -> bool:
        raise ZeroDivisionError("vacuum gauge")

    run.fake.tool.can_hold = broken
    story = run.tell(at_rest)
    assert (story.arm_state, story.verdict) == (arm, "Grasp: ZeroDivisionError: vacuum gauge")
    assert story.advice[0].startswith(first)
    assert re.fullmatch(r"record/test_diagnosis\.py:\d+, in broken", story.raised_at)
    assert story.node.path == "tree/5:retry/do/Grasp"


def test_the_picture_is_named_relative_to_a_relative_run_directory() -> None:
    run = FailedRun(PICK, objects=CUBE)

    def stop() -> bool:
        raise KeyboardInterrupt

    run.fake.tool.can_hold = stop
    Path("frames").mkdir()
    Path("frames/000425_cube-1.jpg").touch()
    assert run.tell().picture == "frames/000425_cube-1.jpg"
