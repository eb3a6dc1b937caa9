"""Fault campaigns on the fake cell: the list of faults, single trials, their checks, and whole campaigns."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.behaviours import load_skills
from executive.campaign import faults as campaigns
from executive.campaign.fault_list import INJECTED_MESSAGE, FaultLister, PlannedFault, SkillFault
from executive.campaign.faults import Campaign, Trial, run_trial
from executive.campaign.jobs import JobOptions, MissionUnderTest
from executive.errors import InputError
from executive.events import RunEnded
from executive.mission.analysis import UnhandledFailure
from executive.mission.load import load_mission
from executive.station.station import AUDIT_KEYS
from executive.testing.fake_cell import FakeCell
from executive.testing.faulty_cell import ScheduledFault

SLOW = pytest.mark.slow
MISSION = """\
mission: small
description: One object, if there is one.
cell: cells/kitting.yaml
routes: {bolt: tray_1, nut: tray_2, washer: scrap_bin}

tree:
  try:
    - fallback:
        - Detect
        - Detect: {doubtful: pass}
    - Localize
    - try: [SelectTarget, Approach, Grasp, Transit, Release]
      catch:
        - on: [Grasp.missed]
          do: RejectTarget
        - on: [Approach.blocked]
          do: {Wait: {seconds: 0.1}}
  finally: MoveToScan
"""


@pytest.fixture(scope="session")
def campaign() -> Campaign:
    mission = load_mission("sort_overhead", load_skills())
    return Campaign(MissionUnderTest(mission, FakeCell, "fake", 0), JobOptions(workers=1))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> MissionUnderTest:
    folder = tmp_path_factory.mktemp("small")
    (folder / "cells").mkdir()
    shutil.copy(Path(__file__).parents[2] / "missions" / "cells" / "kitting.yaml", folder / "cells")
    (folder / "small.yaml").write_text(MISSION)
    loaded = load_mission(folder / "small.yaml", load_skills(), {"cell.table.objects": "[1, 1]"})
    return MissionUnderTest(loaded, FakeCell, "fake", 0)


def find_number(campaign: Campaign, name: str, kind: str, occasion: str = "first") -> int:
    """Return the number of the first fault of a node or part that has a cause in the cell, if any has one."""
    return next(
        number
        for number, fault in enumerate(campaign.faults, 1)
        if (fault.name.split()[0], fault.kind, fault.occasion) == (name, kind, occasion)
        and not fault.replaces_previous
    )


def try_faults(campaign: Campaign, *numbers: int) -> Trial:
    return run_trial(campaign.mission, campaign.select_faults(numbers), campaign.nominal_run)


def test_every_reason_and_bug_of_every_node_is_listed_and_so_are_faults_of_parts(campaign: Campaign) -> None:
    listed = {(fault.location, fault.kind, fault.occasion) for fault in campaign.faults}
    nodes = [node for node in campaign.mission.loaded.tree.walk() if hasattr(node, "skill")]
    assert len(nodes) >= 20
    for node in nodes:
        assert (node.path, "raises", "middle") in listed
        for reason in campaign.mission.loaded.skills[node.skill].reasons:
            assert {(node.path, reason, "first"), (node.path, reason, "lasting")} <= listed
    kinds = {(fault.name.split()[0], fault.kind) for fault in campaign.faults}
    assert kinds >= {
        *(("detector", f"{kind} for {time} s") for kind in ("hangs", "dead", "unsure") for time in (0.5, 5)),
        ("object", "object_removed"), ("object", "object_moved"), ("Approach", "target: object_removed"),
        ("Transit", "grip lost"), ("tool", "no grip for 5 s"), ("tool", "no grip on an object"),
    }  # fmt: skip
    middle = {fault.name.split()[0] for fault in campaign.faults if fault.occasion == "middle"}
    assert {"Grasp", "Transit", "Approach", "detector"} <= middle


def test_a_reason_is_caused_in_the_cell_or_else_by_the_skill(campaign: Campaign) -> None:
    for previous, fault in zip(campaign.faults, campaign.faults[1:], strict=False):
        if fault.replaces_previous:
            same = ("location", "kind", "occasion")
            assert [getattr(previous, name) for name in same] == [getattr(fault, name) for name in same]
            assert isinstance(previous.injected, ScheduledFault) and isinstance(fault.injected, SkillFault)
    first = {fault.kind: fault for fault in reversed(campaign.faults) if not fault.replaces_previous}
    assert str(first["missed"]).endswith("Grasp missed, first: grip_fails")
    assert str(first["doubtful"]).endswith("SelectTarget doubtful, first: without a cause")
    conditional = {fault.name.split()[0] for fault in campaign.faults if fault.is_conditional}
    assert "RejectTarget" in conditional and "Grasp" not in conditional
    run = campaign.nominal_run
    again = FaultLister(campaign.mission, run.steps_by_path, run.robot_time).list_faults()
    assert list(again) == pickle.loads(pickle.dumps(campaign.faults))


@pytest.mark.parametrize(
    ("name", "kind", "occasion", "verdict"),
    [
        ("Grasp", "missed", "first", "ok"),
        ("Detect", "unavailable", "lasting", "FAILURE Detect.unavailable"),
        pytest.param("Grasp", "missed", "lasting", "FAILURE Grasp.sensor_implausible", marks=SLOW),
        pytest.param("Approach", "target: object_removed", "middle", "FAILURE lost", marks=SLOW),
        pytest.param("object", "object_removed", "late", "FAILURE lost", marks=SLOW),
    ],
)
def test_a_fault_is_dealt_with(campaign: Campaign, name: str, kind: str, occasion: str, verdict: str) -> None:
    trial = try_faults(campaign, find_number(campaign, name, kind, occasion))
    assert (trial.verdict, trial.have_occurred, trial.had_effect, trial.problems) == (verdict, True, True, ())


def test_a_bug_ends_the_run_as_a_fault_of_its_node(campaign: Campaign) -> None:
    number = find_number(campaign, "Transit", "raises", "middle")
    trial = try_faults(campaign, number)
    assert (trial.status, trial.have_occurred, trial.problems) == ("FAULT", True, ())
    assert trial.node == campaign.faults[number - 1].location


def test_a_node_behind_another_fault_is_reached_with_it(campaign: Campaign) -> None:
    behind = find_number(campaign, "PutDown", "dropped")
    alone = try_faults(campaign, behind)
    assert (alone.verdict, alone.status, alone.had_effect) == ("-", "SUCCESS", False)
    both = try_faults(campaign, find_number(campaign, "Transit", "unreachable"), behind)
    assert (both.verdict, both.had_effect, both.problems) == ("ok", True, ())
    assert campaign.faults[behind - 1].location in both.steps_by_path
    assert both.fault_option.endswith(f"+{behind}")


def test_a_run_that_never_ends_is_ended(campaign: Campaign) -> None:
    fault = campaign.faults[find_number(campaign, "SelectTarget", "unseen", "lasting") - 1]
    endless = replace(fault, injected=replace(fault.injected, activations=range(1, 9999)))
    trial = run_trial(campaign.mission, {1: endless}, replace(campaign.nominal_run, robot_time=-5.0))
    assert "FAULT at no node: the mission has not ended after 10 s" in trial.problems[0]


class LyingCell(FakeCell):
    """A cell whose audit finds one object in a wrong bin, and whose arm moves after the run."""

    def audit(self) -> dict[str, int]:
        counts = super().audit()
        arm = self.unrecorded_cell.arm
        arm.start(arm.plan("aside").result())
        return {**counts, "right": counts["right"] - 1, "wrong_bin": 1}


def test_problems_at_the_end_are_found(campaign: Campaign) -> None:
    mission = replace(campaign.mission, make_cell=LyingCell)
    faults = campaign.select_faults((find_number(campaign, "Grasp", "missed"),))
    trial = run_trial(mission, faults, campaign.nominal_run)
    assert trial.verdict == "!!"
    assert trial.problems[0].startswith("1 objects in wrong bins")
    assert "the arm is not at rest" in trial.problems


def end(status: str, reason: str = "", message: str = "", node: str = "") -> RunEnded:
    return RunEnded(status, reason, message, node, True, "", 10, 1.0)


LOST = end("FAILURE", "lost")
EARLY = end("FAILURE", "Detect.unavailable", "", "tree/Detect")


@pytest.mark.parametrize(
    ("run_end", "raised_bugs", "problem"),
    [
        (end("FAULT", "fault", INJECTED_MESSAGE, "tree/Grasp"), ["tree/Grasp"], ""),
        (end("FAULT", "fault", INJECTED_MESSAGE, "tree/Wait"), ["tree/Grasp"], "FAULT at tree/Wait"),
        (end("FAULT", "fault", "KeyError", "tree/Grasp"), ["tree/Grasp"], "FAULT at tree/Grasp: KeyError"),
        (end("SUCCESS"), ["tree/Grasp"], "the injected error was raised"),
        (end("FAILURE", "Grasp.missed", "", "tree/Grasp"), [], ""),
        (end("FAILURE", "lost"), [], ""),
        (end("FAILURE", "Wait.missed", "", "tree/Wait"), [], "lists no such end"),
    ],
)
def test_a_run_ends_as_its_faults_require(run_end: RunEnded, raised_bugs: list[str], problem: str) -> None:
    unhandled = (UnhandledFailure("Grasp", "missed", "tree/Grasp", "a.yaml", 3),)
    problems = list(campaigns.check_end(run_end, raised_bugs, unhandled))
    assert len(problems) == bool(problem) and all(problem in found for found in problems)


@pytest.mark.parametrize(
    ("run_end", "items", "audit", "effects", "problem"),
    [
        (end("INCOMPLETE"), {}, {}, [], ""),
        (end("INCOMPLETE"), {"seen": 4}, {}, [], "does not balance"),
        (end("INCOMPLETE"), {}, {"right": 1, "wrong_bin": 1}, [], "1 objects in wrong bins"),
        (end("INCOMPLETE"), {"rejected": 0, "skipped": 1}, {"right": 3, "left": 0}, [], "the ledger says"),
        (end("INCOMPLETE"), {}, {"left": 2, "unseen": 1}, [], "the ledger says"),
        # A removed object may still be in the ledger, or count as lost.
        (end("INCOMPLETE"), {}, {"left": 0, "elsewhere": 1}, ["object_removed"], ""),
        (end("INCOMPLETE"), {}, {"left": 0, "elsewhere": 1}, ["object_moved"], "the ledger says"),
        (end("INCOMPLETE"), {}, {"left": 0, "elsewhere": 1}, [], "out of reach"),
        (LOST, {"rejected": 0, "lost": 1}, {"left": 0, "elsewhere": 1}, ["object_removed"], ""),
        # A dropped object that nobody saw again may be anywhere.
        (LOST, {"rejected": 0, "lost": 1}, {}, ["grip_lost"], ""),
        (EARLY, {"rejected": 0, "lost": 1}, {"right": 3}, [], ""),
        (end("FAULT"), {}, {"right": 1, "left": 2}, [], "the ledger says"),
        (end("FAULT"), {}, {"right": 3, "left": 0}, [], "the ledger says"),
    ],
)  # fmt: skip
def test_the_ledger_agrees_with_the_world(
    run_end: RunEnded, items: Mapping[str, int], audit: Mapping[str, int], effects: list[str], problem: str
) -> None:
    counts = {"seen": 3, "placed": 2, "rejected": 1, "skipped": 0, "lost": 0, "phantom": 0} | items
    places = {**dict.fromkeys(AUDIT_KEYS, 0), "right": 2, "left": 1, **audit}
    problems = list(campaigns.check_ledger(run_end, counts, places, effects))
    assert bool(problems) == bool(problem) and problem in "".join(problems[:1])


def run_in_process(jobs: list[Any], run_job: Callable[[Any], Trial], *_: object) -> list[Trial]:
    return [run_job(job) for job in jobs]


@pytest.mark.slow
def test_a_campaign_tries_every_fault_and_enters_every_recovery(
    small: MissionUnderTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaigns, "run_jobs", run_in_process)
    campaign = Campaign(small)
    campaign.run_single_faults()
    tried = [list(trial.faults)[-1] for trial in campaign.trials]
    assert tried == sorted(set(tried)) and campaign.is_complete
    assert not any(trial.problems for trial in campaign.trials)
    # A skill does not fail without a cause if the cell has caused the failure.
    effective = {list(trial.faults)[-1] for trial in campaign.trials if trial.had_effect}
    omitted = set(range(1, len(campaign.faults) + 1)).difference(tried)
    assert omitted == {number for number, fault in enumerate(campaign.faults, 1)
                       if fault.replaces_previous and number - 1 in effective}  # fmt: skip
    entries = campaigns.count_branch_entries(campaign)
    names = [branch.split(": ")[1] for branch in entries]
    assert names == ["finally", "choice 2", "catch on Grasp.missed", "catch on Approach.blocked"]
    assert min(entries.values()) > 0
    first_faults = [str(next(iter(trial.faults.values()))) for trial in campaign.trials]
    behind = [list(trial.faults.values())[-1].name.startswith("RejectTarget") for trial in campaign.trials]
    assert "Grasp missed, first: grip_fails" in first_faults[behind.index(True)]
    campaign.trials = [
        trial
        for trial, fault in zip(campaign.trials, first_faults, strict=True)
        if "missed" not in fault and "no grip" not in fault
    ]
    entries = campaigns.count_branch_entries(campaign)
    assert [branch.split(": ")[1] for branch, count in entries.items() if not count] == names[2:3]


@pytest.mark.slow
def test_pairs_depend_on_the_seed_only(small: MissionUnderTest, monkeypatch: pytest.MonkeyPatch) -> None:
    two, one, other = (
        Campaign(replace(small, seed=seed), JobOptions(workers=workers))
        for seed, workers in ((0, 2), (0, 1), (3, 1))
    )
    two.run_fault_pairs(3)
    monkeypatch.setattr(campaigns, "run_jobs", run_in_process)
    one.run_fault_pairs(3)
    other.run_fault_pairs(3)
    assert (one.trials, [len(trial.faults) for trial in one.trials]) == (two.trials, [2] * 3)
    assert [trial.fault_option for trial in one.trials] != [trial.fault_option for trial in other.trials]


class BrokenCell(FakeCell):
    """A cell that breaks."""

    def advance(self) -> None:
        raise RuntimeError("broken")


def test_a_mission_that_fails_without_a_fault_is_refused(small: MissionUnderTest) -> None:
    with pytest.raises(InputError, match=r"without a fault, small with seed 0 ends as FAULT .* another seed"):
        Campaign(replace(small, make_cell=BrokenCell))


FAULT = PlannedFault(
    "tree/Grasp", "Grasp sort.yaml:7", "missed", "first", SkillFault("Grasp", "missed", (1,))
)
FAILED = "FAILURE Grasp.missed"
TRIAL = Trial("SUCCESS", "", "", "", True, "", 10, 1.0, faults={1: FAULT}, have_occurred=True)


def test_results_are_one_table_the_problems_and_the_unused_branches(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    failure = {"status": "FAILURE", "reason": "Grasp.missed", "node": "tree/Grasp"}
    failed = replace(TRIAL, faults={1: FAULT, 5: FAULT}, **failure)
    wrong = replace(failed, problems=("the arm is not at rest",))
    fewer = replace(TRIAL, missing_count=3)
    trials = [TRIAL, TRIAL, fewer, replace(TRIAL, have_occurred=False), failed, wrong]
    monkeypatch.setattr(campaign, "trials", trials)
    monkeypatch.setattr(campaign, "is_complete", False)
    lines = list(campaigns.list_result_lines(campaign))
    assert f"{'missed':30} ok (2), ok -3 (1), - (1), {FAILED} (1), !! (1)" in lines[2]
    assert lines[3:7] == [
        "  runs with a problem: 1",
        f"    fault 1+5: {FAULT}; and {FAULT}",
        f"      {FAILED} at tree/Grasp",
        "      wrong: the arm is not at rest",
    ]
    branches = campaigns.count_branch_entries(campaign)
    assert branches and lines[8:] == [f"    never entered: {branch}" for branch in branches]
    plain = json.loads(json.dumps(campaigns.results_to_json(campaign)))
    assert (len(plain["trials"]), plain["complete"], plain["branches"]) == (6, False, branches)
    assert [(trial["fault"], trial["verdict"]) for trial in plain["trials"]][-1] == ("1+5", "!!")
