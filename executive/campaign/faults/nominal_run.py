"""Nominal run of a campaign: a run without faults, from which the times of faults are computed."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from executive.campaign.faults.trial_checks import format_counts
from executive.campaign.mission_under_test import MissionUnderTest
from executive.errors import InputError
from executive.events import NodeEnded, NodeStarted, TimedEvent
from executive.record.audit_comparison import is_confirmed_by_audit
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


class ActivationRecorder:
    """Observer that records the activations of nodes.

    Attributes:
        start_counts: Number of activations, by path of the node.
        start_ticks: Tick of the start of each running node, by path.
        step_counts: Number of control steps of each ended activation, by path.
    """

    def __init__(self) -> None:
        self.start_counts: Counter[str] = Counter()
        self.start_ticks: dict[str, int] = {}
        self.step_counts: dict[str, list[int]] = defaultdict(list)

    def __call__(self, timed: TimedEvent) -> None:
        """Record the start or the end of a node."""
        match timed.event:
            case NodeStarted(node):
                self.start_counts[node] += 1
                self.start_ticks[node] = timed.tick
            case NodeEnded(node) if node in self.start_ticks:
                self.step_counts[node].append(timed.tick - self.start_ticks.pop(node))


def execute_nominal_run(mission: MissionUnderTest) -> NominalRun:
    """Execute a mission without faults and return the results.

    Raises:
        InputError: The mission does not succeed, or ledger and ground truth disagree.
        KeyboardInterrupt: The user halted the run.
    """
    activations = ActivationRecorder()
    options = RunOptions(mission.seed, mission.requests, make_cell=mission.make_cell)
    run = assemble(mission.loaded, mission.skills, options, [activations])
    with closing(run):
        end = run.execute()
        if end.status == "HALTED":
            raise KeyboardInterrupt
        items, audit = run.count_items(), run.count_ground_truth()
    description = f"without a fault, {mission.name} with seed {mission.seed}"
    if end.status != "SUCCESS":
        raise InputError(
            f"{description} ends as {end.status} {end.reason}: {end.message}; "
            "a campaign needs a run that succeeds: choose another seed"
        )
    if audit is not None and (audit["unseen"] or not is_confirmed_by_audit(items, audit, end.is_table_empty)):
        raise InputError(
            f"{description} ends with a wrong ledger: the ledger says {format_counts(items)}; the audit "
            f"{format_counts(audit)}; choose another seed, or a mission that observes the whole table"
        )
    steps_by_path = {path: tuple(counts) for path, counts in activations.step_counts.items()}
    return NominalRun(end.robot_time, items["placed"], steps_by_path)
