"""Nominal run of a campaign: a run without faults, from which the times of faults are computed."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from executive.campaign.faults.trial_checks import format_counts
from executive.campaign.mission_under_test import MissionUnderTest
from executive.errors import InputError
from executive.record.result import is_confirmed_by_audit
from executive.record.timeline.activation import group_by_node
from executive.record.timeline.timeline import Timeline
from executive.run.assembly import RunOptions, assemble

MIN_TIMEOUT = 60.0
"""Minimum timeout of a run with faults, on the run's clock [s]."""
TIMEOUT_FACTOR = 10.0
"""Additional timeout of a run with faults, as a multiple of the duration of the nominal run."""


@dataclass(frozen=True)
class NominalRun:
    """Results of a run without faults.

    Attributes:
        duration: Duration on the run's clock [s].
        placed_count: Number of objects in bins at the end.
        steps_by_path: Number of control steps of each activation of a node, by path of the node.
    """

    duration: float
    placed_count: int
    steps_by_path: Mapping[str, tuple[int, ...]]

    @property
    def timeout(self) -> float:
        """Timeout of a run with faults, on the run's clock [s]."""
        return MIN_TIMEOUT + TIMEOUT_FACTOR * self.duration


def execute_nominal_run(mission: MissionUnderTest) -> NominalRun:
    """Execute a mission without faults and return the results.

    Raises:
        InputError: The mission does not succeed, or ledger and ground truth disagree.
        KeyboardInterrupt: The user halted the run.
    """
    timeline = Timeline()
    options = RunOptions(mission.seed, mission.requests, make_cell=mission.make_cell)
    run = assemble(mission.loaded, options, [timeline])
    with closing(run):
        end = run.execute()
        if end.status == "HALTED":
            raise KeyboardInterrupt
        items, audit = run.count_items(), run.count_ground_truth()
    description = f"without a fault, {mission.name} with seed {mission.seed}"
    if end.status != "SUCCESS":
        advice = "a campaign needs a run that succeeds: choose another seed"
        raise InputError(f"{description} ends as {end.status} {end.reason}: {end.message}; {advice}")
    if audit is not None and (audit["unseen"] or not is_confirmed_by_audit(items, audit, end.is_table_empty)):
        problem = f"the ledger says {format_counts(items)}; the audit {format_counts(audit)}"
        advice = "choose another seed, or a mission that observes the whole table"
        raise InputError(f"{description} ends with a wrong ledger: {problem}; {advice}")
    steps_by_path = {
        path: tuple(each.end_tick - each.start_tick for each in activations)
        for path, activations in group_by_node(timeline.activations).items()
    }
    return NominalRun(end.robot_time, items["placed"], steps_by_path)
