"""Motions planned ahead: into the bin once the tool holds, and to the next target during the carry."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import at_hand
import pytest

from executive.cell.arm import Goal
from executive.cell.device_config import STEP
from executive.cell.objects import Target
from executive.errors import Unreachable
from executive.events import FrameSearched, MotionPlanned, TargetSelected, TimedEvent
from executive.manipulation.tool_goals import sort_pickable_targets
from executive.motion.configurations import ConfigurationPairs, find_configuration_pairs
from executive.motion.joints import Kinematics
from executive.run.run import Run
from executive.skill import Skill, SkillFailed
from executive.testing.fake_cell import FakeCell
from skills.approach import Approach
from skills.grasp import Grasp
from skills.put_down import PutDown
from skills.release import Release
from skills.select_target import SelectTarget
from skills.transit import Transit

LATENCY = 0.1
"""Time that a plan takes in the shipped cell [s]."""


class Bench:
    """A fake cell with a cube in the middle of its table, driven by skills as a run drives it.

    Attributes:
        plans: Planned motions.
        decisions: Items of all `decision` events.
    """

    def __init__(self) -> None:
        self.plans: list[MotionPlanned] = []
        self.decisions: list[str] = []
        self.mission_run = Run("bench", [self.note])
        self.fake = FakeCell(emit=self.mission_run.emit)
        self.mission_run.connect(self.fake, STEP)
        self.mission_run.begin_step(0)
        self.look = partial(at_hand.look, self.fake)
        self.fake.world.put("cube", 0.5, 0.0)

    def note(self, timed: TimedEvent) -> None:
        if isinstance(timed.event, MotionPlanned):
            self.plans.append(timed.event)
        elif isinstance(timed.event, TargetSelected):
            self.decisions.append(timed.event.item)

    def run(self, skill: Skill, meanwhile: Callable[[], object] = lambda: None) -> Skill:
        """Run a skill to its end; call `meanwhile` once, 30 control steps after its beginning."""
        for tick, _ in enumerate(skill.run(self.mission_run.cell) or ()):
            if tick == 30:
                meanwhile()
            self.mission_run.plan_ahead()
            self.mission_run.advance()
        return skill

    def grasp(self, targets: list[Target]) -> Any:
        """Select a target and grasp it; return the skill that selected."""
        selected = self.run(SelectTarget(targets=targets))
        self.run(Approach(target=selected.target))
        self.run(Grasp(target=selected.target))
        return selected

    def carry(self, targets: list[Target], bin: str | None = None, meanwhile: Any = lambda: None) -> None:
        """Select a target and bring it into a bin, that of its class if not told otherwise."""
        selected = self.grasp(targets)
        bin = bin or selected.bin
        self.run(Transit(held=selected.item, bin=bin), meanwhile)
        self.run(Release(held=selected.item, bin=bin))

    @property
    def ahead(self) -> list[bool]:
        """For each motion so far, True if it was planned ahead."""
        return [plan.planned_ahead for plan in self.plans]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize("label", ["cube", "duck"], ids=["same bin", "other bin"])
def test_after_the_first_approach_nothing_is_waited_for(bench: Bench, label: str) -> None:
    bench.fake.world.put(label, 0.6, 0.15)
    targets = bench.look()
    bench.carry(targets)
    bench.carry(targets)
    assert bench.ahead == [False, True, True, True]
    assert [plan.delay for plan in bench.plans] == [LATENCY, 0, 0, 0]


def test_the_next_target_is_the_one_that_is_selected_when_the_arm_is_free(bench: Bench) -> None:
    bench.fake.routes["cube"] = ("red_bin", "blue_bin")
    # The one is nearer to the bin, the other to where the arm picks.
    bench.fake.world.put("cube", 0.45, -0.2)
    bench.fake.world.put("cube", 0.6, 0.1)
    targets = bench.look()
    bench.carry(targets[:1])
    assert bench.decisions == ["cube-1"], "planning ahead decides nothing"
    selected = bench.run(SelectTarget(targets=targets))
    assert (selected.item, selected.bin) == ("cube-2", "blue_bin")
    bench.run(Approach(target=selected.target))
    assert bench.ahead[-1]


@pytest.mark.parametrize("change", ["moved", "another"])
def test_an_approach_that_was_not_foreseen_is_waited_for(bench: Bench, change: str) -> None:
    duck = bench.fake.world.put("duck", 0.6, 0.15)
    bench.fake.world.put("sphere", 0.6, -0.2)
    targets = bench.look()
    bench.carry(targets[:1])
    if change == "moved":
        duck.position[0] += 0.002
        targets = bench.look()
    bench.run(Approach(target=sort_pickable_targets(bench.mission_run.cell, targets)[change == "another"]))
    assert (bench.ahead[-1], bench.plans[-1].delay) == (False, LATENCY)


def test_a_carry_to_another_bin_is_waited_for_and_the_approach_after_it_is_not(bench: Bench) -> None:
    bench.fake.world.put("duck", 0.6, 0.15)
    targets = bench.look()
    bench.carry(targets[:1], "yellow_bin")
    bench.carry(targets)
    assert bench.ahead == [False, False, True, True]


@pytest.fixture
def planned(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> list[Goal]:
    """The goals that the arm was asked to plan ahead."""
    planned: list[Goal] = []
    monkeypatch.setattr(bench.fake.unrecorded_cell.arm, "plan_ahead", lambda goal, task: planned.append(goal))
    return planned


def test_the_transit_is_planned_in_the_control_step_after_the_command_to_grip(
    bench: Bench, planned: list[Goal]
) -> None:
    selected = bench.run(SelectTarget(targets=bench.look()))
    bench.run(Approach(target=selected.target))
    bench.mission_run.cell.tool.close()
    bench.mission_run.plan_ahead()
    assert planned == []
    bench.mission_run.advance()
    bench.mission_run.plan_ahead()
    assert len(planned) == 1


def test_a_look_during_a_transit_lets_the_planner_plan_in_the_next_control_step(
    bench: Bench, planned: list[Goal]
) -> None:
    bench.fake.world.put("duck", 0.6, 0.15)
    targets = bench.look()
    counts: list[int] = []

    def look_again() -> None:
        bench.look()
        bench.mission_run.emit(FrameSearched(9, "overhead", "embedded", "table", [], [], []))
        counts.append(len(planned))
        bench.mission_run.plan_ahead()
        counts.append(len(planned))

    bench.carry(targets[:1], meanwhile=look_again)
    assert counts[0] == counts[1] < len(planned)


def test_while_the_arm_does_not_carry_into_a_bin_no_approach_is_planned(
    bench: Bench, planned: list[Goal]
) -> None:
    bench.fake.world.put("duck", 0.6, 0.15)
    selected = bench.grasp(bench.look()[:1])
    bench.run(PutDown(held=selected.item))
    assert [goal.position[:2] for goal in planned] == [tuple(bench.fake.cell.bins["red_bin"].slots[0])]


def test_what_cannot_be_picked_is_not_planned(bench: Bench, planned: list[Goal]) -> None:
    bench.fake.world.put("sphere", 0.6, 0.2)
    bench.fake.world.put("duck", 0.55, 0.0)
    targets = bench.look()
    bench.fake.ledger.reject("sphere-1", "slippery")
    bench.carry(targets[:1])
    assert len(planned) == 1, "the duck stands so near that the pick may have moved it"


def test_a_target_out_of_reach_fails_in_its_approach_only(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find_near_pairs(kinematics: Kinematics, goal: Goal, *others: Any) -> ConfigurationPairs:
        if goal.position[0] > 0.55:
            raise Unreachable("beyond the reach of the arm")
        return find_configuration_pairs(kinematics, goal, *others)

    monkeypatch.setattr("executive.motion.planner.find_configuration_pairs", find_near_pairs)
    bench.fake.world.put("duck", 0.6, 0.2)
    cube, duck = bench.look()
    bench.carry([cube])
    with pytest.raises(SkillFailed, match="beyond the reach of the arm") as failure:
        bench.run(Approach(target=duck))
    assert (failure.value.reason, bench.ahead[-1]) == ("unreachable", True)


@pytest.mark.parametrize(("item", "bin"), [("thing-1", "red_bin"), ("cube-1", "nowhere")])
def test_a_decision_for_something_unknown_plans_nothing_and_ends_nothing(
    bench: Bench, item: str, bin: str
) -> None:
    targets = bench.look()
    bench.run(Approach(target=targets[0]))
    bench.mission_run.emit(TargetSelected(item, "cube", 1, bin))
    bench.run(Grasp(target=targets[0]))
    bench.run(Transit(held="cube-1", bin="red_bin"))
    assert bench.ahead[-1] is False
