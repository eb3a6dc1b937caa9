"""Single faults on the fake cell: what survives, and what is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executive.campaign.faults.campaign import Campaign
from executive.campaign.faults.planned_fault import SkillFault, make_substitutes
from executive.campaign.faults.results import Trial
from executive.campaign.faults.trial import record_trial, run_trial
from executive.cells.fake.cell import FakeCell
from executive.events import FaultInjected, ItemChanged, NodeEnded, RunEnded
from executive.plugins import load_skills
from executive.record.journal import read_journal
from executive.testing.run_mission import run_mission


def number_of(campaign: Campaign, name: str, what: str, when: str = "first", *, behind: bool = False) -> int:
    """Return the number of the first fault like that."""
    return next(
        number
        for number, fault in enumerate(campaign.faults, 1)
        if (fault.name, fault.kind, fault.occasion, fault.is_conditional) == (name, what, when, behind)
        and not fault.replaces_previous
    )


def tried(campaign: Campaign, *numbers: int) -> Trial:
    return run_trial(campaign.mission, campaign.nominal_run, campaign.select_faults(numbers))


SLOW = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "what", "when", "verdict"),
    [
        ("Grasp", "missed", "first", "ok"),
        ("Grasp", "missed", "lasting", "ok -6"),
        ("Release", "stuck", "lasting", "FAILURE Release.stuck"),
        ("Approach", "target removed", "middle", "FAILURE lost"),
        ("detector", "hangs to the end", "middle", "FAILURE Detect.unavailable"),
        pytest.param("Approach", "no_contact", "middle", "ok", marks=SLOW),
        pytest.param("Approach", "unreachable", "middle", "ok -1", marks=SLOW),
        pytest.param("Detect", "unavailable", "lasting", "FAILURE Detect.unavailable", marks=SLOW),
        pytest.param("SelectTarget", "doubtful", "middle", "ok", marks=SLOW),
        pytest.param("detector", "dead for 0.5 s", "first", "ok", marks=SLOW),
        pytest.param("object", "removed", "late", "FAILURE lost", marks=SLOW),
        pytest.param("object", "bumped", "late", "ok", marks=SLOW),
        pytest.param("tool", "no seal on object 1", "lasting", "ok -1", marks=SLOW),
    ],
)
def test_a_fault_is_dealt_with(campaign: Campaign, name: str, what: str, when: str, verdict: str) -> None:
    trial = tried(campaign, number_of(campaign, name, what, when))
    assert (trial.verdict, trial.have_occurred, trial.had_effect, trial.problems) == (verdict, True, True, ())


@pytest.mark.parametrize(
    ("name", "what", "when"),
    [
        pytest.param("Grasp", "raises", "first", marks=SLOW),
        ("Transit", "raises", "middle"),
        ("Detect", "halted", "middle"),
    ],
)
def test_a_bug_ends_the_run_as_a_fault_of_its_node(
    campaign: Campaign, name: str, what: str, when: str
) -> None:
    number = number_of(campaign, name, what, when)
    trial = tried(campaign, number)
    assert (trial.status, trial.have_occurred, trial.problems) == ("FAULT", True, ())
    assert "InjectedError" in trial.message
    assert campaign.faults[number - 1].location in (trial.node, trial.message.partition(": ")[0])


def test_what_runs_only_behind_another_fault_is_reached_with_it(campaign: Campaign) -> None:
    behind = number_of(campaign, "PutDown", "dropped", behind=True)
    alone = tried(campaign, behind)
    assert (alone.verdict, alone.status) == ("-", "SUCCESS")
    both = tried(campaign, number_of(campaign, "Transit", "unreachable"), behind)
    assert (both.verdict, both.had_effect, both.problems) == ("ok", True, ())
    assert campaign.faults[behind - 1].location in both.entered_paths
    assert both.fault_option.endswith(f"+{behind}")


def test_no_skill_says_that_it_dropped_what_sticks(campaign: Campaign) -> None:
    numbers = [number_of(campaign, "Release", what, "lasting") for what in ("stuck", "dropped")]
    trial = tried(campaign, *numbers)
    assert (trial.status, trial.reason, trial.problems) == ("FAILURE", "Release.stuck", ())


def test_what_cannot_happen_there_found_no_occasion(campaign: Campaign) -> None:
    # The camera of the cell sees the whole table: nothing moves before the first look.
    trial = tried(campaign, number_of(campaign, "MoveToScan", "unreachable"))
    assert (trial.verdict, trial.had_effect) == ("-", False)


def test_a_run_that_never_ends_is_ended_and_found(campaign: Campaign) -> None:
    number = number_of(campaign, "SelectTarget", "unseen", "lasting")
    fault = campaign.faults[number - 1]
    assert isinstance(fault.injected, SkillFault)
    ever = replace(fault, injected=replace(fault.injected, activations=()))
    short = replace(campaign.nominal_run, duration=-5.0)
    trial = run_trial(campaign.mission, short, {number: ever})
    assert trial.problems[0] == (
        "the run ended as FAULT at no node: the mission has not ended after 10 s on its clock"
    )


class Liar(FakeCell):
    """A cell whose audit finds one object in a wrong bin."""

    def audit(self) -> dict[str, int]:
        found = super().audit()
        return {**found, "right": found["right"] - 1, "wrong_bin": 1}


class Restless(FakeCell):
    """A cell whose arm never says that it rests, once the run is over."""

    def audit(self) -> dict[str, int]:
        self.arm._path = [self.arm.q] * 9
        return super().audit()


@pytest.mark.parametrize(
    ("kind", "problem"),
    [(Liar, "1 objects in wrong bins; the ledger says seen 6"), (Restless, "the arm is not at rest")],
)
def test_what_is_not_as_it_has_to_be_is_found(campaign: Campaign, kind: type[FakeCell], problem: str) -> None:
    subject = replace(campaign.mission, make_cell=kind)
    number = number_of(campaign, "Grasp", "missed")
    trial = run_trial(subject, campaign.nominal_run, campaign.select_faults((number,)))
    assert trial.verdict == "!!"
    assert trial.problems[0].startswith(problem)


@pytest.mark.slow
def test_a_fault_repeated_is_recorded(campaign: Campaign, tmp_path: Path) -> None:
    numbers = (number_of(campaign, "Grasp", "missed"),)
    trial, path = record_trial(
        campaign.mission, campaign.nominal_run, campaign.select_faults(numbers), tmp_path
    )
    assert trial == tried(campaign, *numbers)
    kinds = [type(timed.event) for timed in read_journal(path / "journal.jsonl")]
    assert (kinds.count(FaultInjected), kinds[-1]) == (1, RunEnded)
    assert (path / "report.html").is_file()


def test_a_skill_that_says_in_its_second_start_that_it_dropped_something_has_let_it_fall() -> None:
    skills = load_skills()
    path = (
        "tree/2:repeat/do/carry_and_watch/try/retry/do/deliver_and_watch/parallel/deliver/1:retry/do/Transit"
    )
    skill_faults = [SkillFault(path, "fails", "dropped", (2,))]
    result = run_mission(
        "sort_overhead", substitutes=make_substitutes(skill_faults, {path: skills["Transit"]})
    )
    events = [timed.event for timed in result.events]
    assert "dropped" in {event.state for event in events if isinstance(event, ItemChanged)}
    ends = [event for event in events if isinstance(event, NodeEnded) and event.node == path]
    assert [end.reason for end in ends][:3] == ["", "dropped", ""]
    assert (result.status, result.agrees) == ("SUCCESS", True)
