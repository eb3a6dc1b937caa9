"""Rows of the results of a sweep: one per run, one per item of a run, and one per skill of a run.

`schema.sql` describes the fields.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path

from executive.cell.json_values import DECIMAL_PLACES
from executive.record.result import Audit, ItemCounts, Result, describe_disagreement
from executive.record.timeline import PlanningTotals, Timeline


@dataclass(frozen=True, kw_only=True)
class SweepSettings:
    """Settings of a sweep, from which its jobs are computed."""

    mission: str
    mission_name: str
    cell: str
    overrides: Mapping[str, str]
    variations: Mapping[str, tuple[str, ...]]
    first_seed: int
    last_seed: int
    scene: Path | None
    saves_images: bool
    inputs_hash: str
    versions: Mapping[str, str]

    @property
    def variants(self) -> list[dict[str, str]]:
        """Each combination of the varied values by name; one empty combination if no value is varied."""
        names = self.variations
        return [dict(zip(names, values, strict=True)) for values in product(*names.values())]


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """A run; `items`, `audit` and `planning` have a column for each of their fields."""

    run_index: int
    seed: int
    variant: Mapping[str, str] = field(default_factory=dict)
    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    items: ItemCounts = field(default_factory=ItemCounts)
    audit: Audit | None = None
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    ticks: int = 0
    robot_time_s: float = 0.0
    wall_time_s: float = 0.0
    decision_hash: str = ""
    run_directory: str = ""
    crashes: int = 0

    @property
    def is_success(self) -> bool:
        """True if the run succeeded."""
        return self.status == "SUCCESS"

    @property
    def problem(self) -> str:
        """Reason for the failure, or "" if there is no problem.

        The value is `disagreement` if the run succeeded but the audit contradicts the ledger.
        """
        if self.is_success:
            return "disagreement" if describe_disagreement(self.audit, self.items) else ""
        return self.reason or self.status

    @property
    def explanation(self) -> str:
        """The message; if it is empty, a description of the disagreement of audit and ledger, or ""."""
        return self.message or describe_disagreement(self.audit, self.items)


@dataclass(frozen=True, kw_only=True)
class ItemRow:
    """An item of the ledger."""

    run_index: int
    item: str
    label: str
    state: str
    bin: str
    failed_attempts: int
    robot_time_s: float


@dataclass(frozen=True, kw_only=True)
class SkillRow:
    """All activations of one skill in a run."""

    run_index: int
    skill: str
    activations: int
    failed_activations: int
    robot_time_s: float


def describe_variant(variant: Mapping[str, str]) -> str:
    """Return the values of the varied params and keys as text, for instance `speed=1, attempts=3`."""
    return ", ".join(f"{key}={value}" for key, value in variant.items())


@dataclass(frozen=True)
class RunRecord:
    """All rows of one run.

    Attributes:
        run: Row of the run.
        items: Rows of the items, in the order of their detection.
        skills: Rows of the skills, in the order of their first activation.
    """

    run: RunRow
    items: tuple[ItemRow, ...] = ()
    skills: tuple[SkillRow, ...] = ()


def make_record(run_index: int, variant: Mapping[str, str], result: Result, timeline: Timeline) -> RunRecord:
    """Return the rows of a run; times are rounded as in `result.json`.

    Args:
        run_index: Index of the run in the sweep.
        variant: Values of the varied params and keys of the cell, by name.
        result: Result of the run.
        timeline: Timeline of the run; it must keep its history (`has_history`).
    """
    run = RunRow(
        run_index=run_index, seed=result.seed, variant=variant,
        status=result.status, reason=result.reason, message=result.message, node=result.node,
        items=result.items, audit=result.audit,
        planning=replace(result.planning, waited_s=round(result.planning.waited_s, DECIMAL_PLACES)),
        ticks=result.ticks,
        robot_time_s=round(result.robot_time_s, DECIMAL_PLACES),
        wall_time_s=round(result.wall_time_s, DECIMAL_PLACES),
        decision_hash=result.trace, run_directory=result.run,
    )  # fmt: skip
    return RunRecord(run, tuple(_list_items(run_index, timeline)), tuple(_list_skills(run_index, timeline)))


def _list_items(run_index: int, timeline: Timeline) -> Iterator[ItemRow]:
    """Yield the row of each item."""
    for name, history in timeline.items.by_name.items():
        last = history.last_change
        yield ItemRow(
            run_index=run_index, item=name, label=last.label, state=last.state, bin=last.bin,
            failed_attempts=last.attempts, robot_time_s=_measure_item_time(name, timeline),
        )  # fmt: skip


def _measure_item_time(name: str, timeline: Timeline) -> float:
    """Return the time during which the item was the selected target and had no final state [s]."""
    end_time = timeline.items.by_name[name].state_change_time
    durations = (
        max(0.0, min(next_time, end_time) - time)
        for (time, item), (next_time, _) in pairwise([*timeline.selection_times, (timeline.clock, "")])
        if item == name
    )
    return round(sum(durations), DECIMAL_PLACES)


def _list_skills(run_index: int, timeline: Timeline) -> Iterator[SkillRow]:
    """Yield the row of each skill."""
    for skill in dict.fromkeys(activation.skill for activation in timeline.activations if activation.skill):
        activations = [activation for activation in timeline.activations if activation.skill == skill]
        time = sum(activation.end - activation.start for activation in activations)
        yield SkillRow(
            run_index=run_index, skill=skill, activations=len(activations),
            failed_activations=sum(activation.status == "FAILURE" for activation in activations),
            robot_time_s=round(time, DECIMAL_PLACES),
        )  # fmt: skip
