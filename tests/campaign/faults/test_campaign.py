"""A whole campaign on a small mission: rounds, coverage, pairs, and Ctrl-C."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.campaign.faults.campaign import Campaign, find_branches
from executive.campaign.faults.results import FaultCampaignResults, Trial
from executive.campaign.mission_under_test import MissionUnderTest
from executive.campaign.pool import JobOptions
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.plugins import load_skills

pytestmark = pytest.mark.slow

MISSION = """\
mission: small
description: One object, if there is one.
cell: cells/fruit.yaml
routes: {apple: premium_crate, banana: premium_crate, orange: market_crate, lemon: juice_crate}

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


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> MissionUnderTest:
    folder = tmp_path_factory.mktemp("small")
    missions = Path(__file__).parents[3] / "missions"
    (folder / "cells").mkdir()
    shutil.copy(missions / "cells" / "fruit.yaml", folder / "cells")
    (folder / "small.yaml").write_text(MISSION)
    loaded = load_mission(folder / "small.yaml", load_skills(), {"cell.table.objects": "[1, 1]"})
    return MissionUnderTest(loaded, FakeCell, "fake", 0)


@pytest.fixture(scope="module")
def figures(small: MissionUnderTest) -> FaultCampaignResults:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("executive.campaign.faults.campaign.run_jobs", one_after_the_other)
        return Campaign(small).run_single_faults()


def one_after_the_other(jobs: list[Any], work: Callable[[Any], Trial], *_: object) -> list[Trial]:
    """Stand for the processes that would do the jobs."""
    return [work(job) for job in jobs]


def test_every_fault_is_tried_once_in_the_order_of_the_list(
    figures: FaultCampaignResults, small: MissionUnderTest
) -> None:
    last = [trial.fault_numbers[-1] for trial in figures.trials]
    assert last == sorted(set(last))
    faults = Campaign(small).faults
    left_out = {number for number in range(1, len(faults) + 1) if number not in last}
    # Only what the cell brought about already is not said by the skill, too.
    raised = {trial.fault_numbers[-1] for trial in figures.trials if trial.had_effect}
    assert left_out
    assert all(faults[number - 1].replaces_previous and number - 1 in raised for number in left_out)
    assert (figures.is_complete, figures.fault_count) == (True, len(faults))


def test_every_way_on_is_entered_the_one_behind_another_fault_with_it(figures: FaultCampaignResults) -> None:
    ways = [(branch.name, branch.mission_line.rpartition(":")[2]) for branch in figures.branches]
    assert ways == [
        ("finally", "18"), ("choice 2", "10"), ("catch on Grasp.missed", "15"),
        ("catch on Approach.blocked", "17"),
    ]  # fmt: skip
    assert figures.unentered_branches == ()
    behind = next(trial for trial in figures.trials if trial.tested_fault.name == "RejectTarget")
    assert (len(behind.fault_numbers), str(next(iter(behind.faults.values()))).rpartition("/")[2]) == (
        2, "Grasp missed, first: the suction cup cannot seal",
    )  # fmt: skip


def test_a_recovery_without_a_run_is_listed_with_its_position(
    figures: FaultCampaignResults, small: MissionUnderTest
) -> None:
    without = [
        trial for trial in figures.trials if "Grasp missed" not in " ".join(map(str, trial.faults.values()))
    ]
    without = [trial for trial in without if not trial.tested_fault.kind.startswith("no seal")]
    assert [
        branch.name for branch in find_branches(small.loaded.tree, without) if not branch.trial_count
    ] == ["catch on Grasp.missed"]


def test_pairs_are_drawn_by_the_seed_and_come_in_the_same_order_from_any_number_of_workers(
    small: MissionUnderTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    two = Campaign(small, JobOptions(workers=2)).run_fault_pairs(3)
    monkeypatch.setattr("executive.campaign.faults.campaign.run_jobs", one_after_the_other)
    one, other = Campaign(small).run_fault_pairs(3), Campaign(replace(small, seed=3)).run_fault_pairs(3)
    assert (one, [len(trial.fault_numbers) for trial in one.trials]) == (two, [2] * 3)
    assert [trial.fault_option for trial in one.trials] != [trial.fault_option for trial in other.trials]


@pytest.fixture
def sigint() -> Iterator[None]:
    """Hear SIGINT: what a shell runs in the background begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt(*progress: int) -> None:
    """Press Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.usefixtures("sigint")
def test_after_ctrl_c_the_finished_trials_are_reported(small: MissionUnderTest) -> None:
    messages: list[str] = []
    campaign = Campaign(small, JobOptions(1, interrupt, lambda: messages.append("halting")))
    figures = campaign.run_single_faults()
    assert (len(figures.trials), figures.is_complete, messages) == (1, False, ["halting"])


def test_an_unknown_number_is_refused_with_the_valid_range(campaign: Campaign) -> None:
    with pytest.raises(InputError) as caught:
        campaign.select_faults((1, 9999))
    assert str(caught.value) == (
        f"sort_overhead has no fault 9999; the numbers are 1 to {len(campaign.faults)}, and --list shows them"
    )


class Empty(FakeCell):
    """A cell that breaks."""

    def advance(self) -> None:
        raise RuntimeError("broken")


def test_a_mission_that_does_not_succeed_by_itself_or_with_wrong_books_is_not_tried(
    small: MissionUnderTest, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"without a fault, small with seed 0 ends as FAULT .* another seed"):
        Campaign(replace(small, make_cell=Empty))
    file = tmp_path / "blind.yaml"
    shutil.copytree(small.loaded.path.parent / "cells", tmp_path / "cells")
    file.write_text(
        "mission: blind\ndescription: d\ncell: cells/fruit.yaml\n"
        "routes: {apple: premium_crate}\ntree: MoveToScan\n"
    )
    with pytest.raises(InputError, match=r"without a fault, blind .* or a mission that observes the whole"):
        Campaign(replace(small, loaded=load_mission(file, load_skills())))
