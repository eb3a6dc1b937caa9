"""Timelines of runs: live and recorded, and their memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from events import at, detected, frame_searched, item_changed, run_started, skill_ended, skill_started
from failed_runs import PICK, FailedRun

from executive.cell.frame import FrameCaptured
from executive.events import (
    BinsEmptied,
    BranchChosen,
    Event,
    FaultInjected,
    MotionPlanned,
    NodeEnded,
    NodeStarted,
    OperatorAsked,
    RequestGiven,
    RunResumed,
    TargetSelected,
)
from executive.record.journal import Journal, read_journal
from executive.record.timeline import (
    PlanningTotals,
    Timeline,
    find_last_failure,
    format_counts,
    group_by_node,
)


def folded(*events: Event, history: bool = True) -> Timeline:
    """Return the timeline of events at the control steps 0, 240, 480, …"""
    timeline = Timeline(history)
    for second, event in enumerate(events):
        timeline(at(240 * second, event))
    return timeline


@pytest.mark.parametrize("mission", [PICK, "pick_on_request"])
def test_the_journal_of_a_run_gives_the_timeline_that_was_observed(mission, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = FailedRun(mission, requests=["cube", "quit"])
    live, journal = Timeline(), Journal(Path("journal.jsonl"))
    run.run.add_observer(live)
    run.run.add_observer(lambda timed: None if isinstance(timed.event, FrameCaptured) else journal(timed))
    run.slip(2)
    run.run.execute()
    journal.close()
    recorded = Timeline.from_events(read_journal(Path("journal.jsonl")))
    assert live.activations and live.items.histories and live.items.look and live.ended
    assert recorded == live
    # Without history, only the past is missing.
    past = {"activations": live.activations, "selection_times": live.selection_times}
    assert replace(run.timeline, has_history=True, **past) == live


def test_an_activation_lasts_from_the_start_of_its_node_to_its_end() -> None:
    timeline = folded(
        NodeStarted("tree"), skill_started("tree/Detect"),
        skill_ended("tree/Detect", "FAILURE", reason="unsure", message="too dark"),
        NodeEnded("tree", "FAILURE", reason="Detect.unsure", message="too dark"),
    )  # fmt: skip
    timeline(at(999, skill_ended("tree/Grasp")))  # an end without a start
    tree, detect = timeline.activations
    assert (tree.start, tree.end, tree.status, tree.failure) == (0, 3, "FAILURE", "Detect.unsure: too dark")
    assert (detect.start_tick, detect.end_tick, detect.skill) == (240, 480, "Detect")
    assert timeline.activation_by_path == {"tree": tree, "tree/Detect": detect}
    assert timeline.root == tree


def test_a_node_that_a_resumed_run_starts_again_was_halted_by_the_interruption() -> None:
    timeline = folded(skill_started("tree/Transit", "cube-1"), RunResumed(240, "", {}),
                      skill_started("tree/Transit", "cube-1"), skill_ended("tree/Transit"))  # fmt: skip
    found = [(one.start, one.end, one.status) for one in timeline.activations]
    assert found == [(0, 2, "INVALID"), (2, 3, "SUCCESS")]


def test_the_ends_of_a_node_are_counted_and_its_last_failure_is_found() -> None:
    ends = [("FAILURE", "missed"), ("FAILURE", "blocked"), ("INVALID", ""), ("SUCCESS", "")]
    timeline = folded(
        *(event for status, reason in ends
          for event in (skill_started("tree/Grasp"), skill_ended("tree/Grasp", status, reason=reason))),
        skill_started("tree/Wait"),
    )  # fmt: skip
    grasp, wait = group_by_node(timeline.activations).values()
    assert (format_counts(grasp), find_last_failure(grasp)) == ("1 done, 2 failed, 1 halted", "blocked")
    assert (format_counts(wait), find_last_failure(wait)) == ("1 running", "")
    assert timeline.end_counts == {"tree/Grasp": {"FAILURE": 2, "INVALID": 1, "SUCCESS": 1}}


def test_the_failures_that_a_control_node_handled_are_counted_with_their_last_message() -> None:
    timeline = folded(
        NodeStarted("tree/retry"), BranchChosen("tree/retry", "attempt 2 of 3", "Grasp.missed", "no seal"),
        BranchChosen("tree/retry", "attempt 3 of 3", "Grasp.missed", "too far"),
    )  # fmt: skip
    retry = timeline.activation_by_path["tree/retry"]
    assert (retry.choice, retry.last_handled_reason) == ("attempt 3 of 3", "Grasp.missed")
    assert (retry.handled_counts, retry.message_by_reason) == (
        {"Grasp.missed": 2},
        {"Grasp.missed": "too far"},
    )


def test_a_control_node_knows_the_skills_that_it_halted() -> None:
    timeline = folded(
        NodeStarted("tree"), skill_started("tree/Wait"), skill_ended("tree/Wait", "INVALID"),
        NodeEnded("tree", "FAILURE", reason="timeout.timeout"),
    )  # fmt: skip
    assert (timeline.activation_by_path["tree"].halted_skills, timeline.halted_skills) == (("tree/Wait",), ())


def test_an_item_has_its_last_sighting_and_failure_and_the_number_of_looks_since_then() -> None:
    far, near = detected("cube", position=[0.9, 0.0, 0.0]), detected("cube", confidence=0.8)
    timeline = folded(
        item_changed("cube-1", position=[0.5, 0.1, 0.0]), frame_searched(far, near, frame=7),
        frame_searched(frame=8), frame_searched(detected("ball"), frame=9),
        skill_started("tree/Grasp", "cube-1"),
        skill_ended("tree/Grasp", "FAILURE", "cube-1", reason="missed"),
    )  # fmt: skip
    item = timeline.items.histories["cube-1"]
    assert (item.look.frame, item.look.confidence, item.later_looks) == (7, 0.8, 2)
    assert (timeline.items.look.frame, timeline.items.look.found) == (9, 1)
    assert list(timeline.items.classes) == ["cube", "ball"]
    assert timeline.failures["cube-1"] == timeline.activation_by_path["tree/Grasp"]


def test_the_accounts_after_the_end_of_the_tree_leave_the_final_states_as_they_were() -> None:
    timeline = folded(
        NodeStarted("tree"), item_changed("cube-1"), item_changed("cube-2", "held"),
        NodeEnded("tree", "FAILURE"), item_changed("cube-1", "rejected"), item_changed("cube-2", "placed"),
    )  # fmt: skip
    assert list(timeline.items.find_items_in_states("seen", "held")) == ["cube-1"]


def test_motions_targets_questions_and_injected_faults_are_kept() -> None:
    selected = TargetSelected("cube-1", "cube", 1, "red_bin")
    timeline = folded(
        run_started(), MotionPlanned(False, 0.05, 1.0), MotionPlanned(True, 0.02, 1.0), selected,
        OperatorAsked(["cube"]), RequestGiven(None), FaultInjected("object removed", "", "", "", []),
    )  # fmt: skip
    assert timeline.planning == PlanningTotals(2, 1, 0.07)
    assert (timeline.selections, timeline.selection_times) == ({"cube-1": selected}, [(3.0, "cube-1")])
    assert (timeline.question, timeline.requests) == (None, [None])
    assert timeline.faults == [(6.0, "object removed")]


@pytest.mark.parametrize(("history", "names"), [(False, ["cube-2"]), (True, ["cube-1", "cube-2"])])
def test_without_history_the_items_of_emptied_bins_are_forgotten(history: bool, names: list[str]) -> None:
    items = [item_changed(f"cube-{number}", "placed", bin=f"bin {number}") for number in (1, 2)]
    timeline = folded(*items, BinsEmptied(["bin 1"]), history=history)
    assert list(timeline.items.changes) == list(timeline.items.histories) == names
