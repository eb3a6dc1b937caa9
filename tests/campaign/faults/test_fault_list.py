"""The list of faults: nothing that a mission's skills declare is left out."""

from __future__ import annotations

import pickle

import pytest

from executive.campaign.faults.campaign import Campaign
from executive.campaign.faults.fault_list import list_faults, list_skill_nodes
from executive.campaign.faults.planned_fault import SkillFault
from executive.campaign.mission_under_test import MissionUnderTest
from executive.cells.fake.cell import FakeCell
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.testing.faults import ScheduledFault


@pytest.mark.parametrize(
    "mission", ["pick_on_request", pytest.param("sort_overhead", marks=pytest.mark.slow)]
)
def test_every_reason_of_every_node_is_there_once_and_lasting_and_so_is_a_bug_in_each(mission: str) -> None:
    subject = MissionUnderTest(load_mission(mission, load_skills()), FakeCell, "fake", 0)
    listed = {(fault.location, fault.kind, fault.occasion) for fault in Campaign(subject).faults}
    nodes = list_skill_nodes(subject)
    assert len(nodes) >= 20
    for node in nodes:
        assert (node.path, "raises", "first") in listed
        for reason in subject.loaded.skills[node.skill].reasons:
            assert {(node.path, reason, "first"), (node.path, reason, "lasting")} <= listed


def test_a_node_that_runs_often_goes_wrong_in_the_middle_too(campaign: Campaign) -> None:
    middle = {
        (fault.name, fault.kind)
        for fault in campaign.faults
        if fault.occasion == "middle" and fault.is_failure_reason
    }
    assert {("Grasp", "missed"), ("Transit", "dropped"), ("Approach", "no_contact")} <= middle


def test_detectors_objects_and_the_tool_go_wrong_too(campaign: Campaign) -> None:
    def list_effects(name: str) -> set[str]:
        return {fault.kind for fault in campaign.faults if fault.name == name and not fault.is_failure_reason}

    ways = ("hangs", "dead", "unsure")
    lasting = {f"{way} for {time}" for way in ways for time in ("0.5 s", "5 s")}
    ever = {f"{way} to the end" for way in ways}
    assert list_effects("detector") == {"slow by 0.5 s", "slow by 5 s"} | lasting | ever
    assert list_effects("object") == {"removed", "bumped"}
    assert list_effects("Approach") >= {"target removed", "target bumped"}
    assert list_effects("Transit") >= {"seal breaks", "seal breaks over a wrong bin"}
    assert list_effects("tool") >= {"no seal for 5 s", "no seal on object 1"}


def test_a_reason_is_brought_about_in_the_cell_and_else_said_by_the_skill(campaign: Campaign) -> None:
    for index, fault in enumerate(campaign.faults):
        if fault.replaces_previous:
            physical = campaign.faults[index - 1]
            assert (physical.location, physical.kind) == (fault.location, fault.kind)
            assert physical.occasion == fault.occasion
            assert isinstance(physical.injected, ScheduledFault)
            assert isinstance(fault.injected, SkillFault)
    of = {
        fault.kind: fault
        for fault in campaign.faults
        if fault.is_failure_reason and not fault.replaces_previous
    }
    assert (of["missed"].cause, of["doubtful"].cause) == (
        "the suction cup cannot seal", "the skill fails without a cause",
    )  # fmt: skip


def test_what_runs_only_after_something_else_is_marked(campaign: Campaign) -> None:
    behind = {fault.name for fault in campaign.faults if fault.is_conditional}
    always = {fault.name for fault in campaign.faults} - behind
    assert {"PutDown", "RejectTarget"} <= behind
    assert {"Grasp", "Transit", "Release"} <= always


def test_the_numbers_are_always_the_same_and_faults_can_be_sent_to_another_process(
    campaign: Campaign,
) -> None:
    again = list_faults(campaign.mission, campaign.nominal_run)
    assert (again, pickle.loads(pickle.dumps(again))) == (tuple(campaign.faults), again)
