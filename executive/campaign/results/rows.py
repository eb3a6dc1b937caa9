"""Rows of the results of a sweep: one per run, one per item of a run, and one per skill of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise, product
from pathlib import Path
from typing import ClassVar

from pydantic import ConfigDict, TypeAdapter

from executive.cell.json_values import DECIMAL_PLACES, to_json
from executive.record.result import Audit, ItemCounts, Result, describe_disagreement
from executive.record.timeline.timeline import PlanningTotals, Timeline


class Row:
    """Base class of the rows.

    The docstring of each field becomes the comment of its SQL column (see `tables.py`).
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(use_attribute_docstrings=True)


@dataclass(frozen=True, kw_only=True)
class SweepSettings(Row):
    """Settings of a sweep, from which its jobs are computed; the table has one row."""

    mission: str
    """Mission file, or name of a shipped mission."""
    mission_name: str
    """Name of the mission."""
    cell: str
    """Path of the cell file."""
    overrides: Mapping[str, str]
    """Values of `--set` by param or by `cell.<key>.<key>`; equal in all runs."""
    variations: Mapping[str, tuple[str, ...]]
    """Values of `--vary` by param or by `cell.<key>.<key>`; each combination is a variant."""
    first_seed: int
    """First seed of each variant."""
    last_seed: int
    """Last seed of each variant."""
    scene: Path | None
    """Scene file; NULL: no change of the simulated world."""
    saves_images: bool
    """1 if the runs save the images on which decisions are based."""
    inputs_hash: str
    """Hash of mission, libraries, cell and scene; `--resume` requires equal inputs."""
    versions: Mapping[str, str]
    """Versions of this project, Python, the machine and the required packages."""

    @property
    def variants(self) -> list[dict[str, str]]:
        """Each combination of the varied values by name; one empty combination if no value is varied."""
        names = self.variations
        return [dict(zip(names, values, strict=True)) for values in product(*names.values())]


@dataclass(frozen=True, kw_only=True)
class RunRow(Row):
    """A run. All columns except `wall_time_s`, `run_directory` and `crashes` are reproducible."""

    run_index: int
    """Index of the run in the sweep, from 0: variant by variant, and seed by seed."""
    seed: int
    """Random seed."""
    variant: Mapping[str, str] = field(default_factory=dict)
    """Values of the varied params and keys of the cell, by name."""
    status: str
    """Final status: SUCCESS, INCOMPLETE, FAILURE or FAULT."""
    reason: str = ""
    """Reason of the failure, for instance `Transit.dropped`; "" on success."""
    message: str = ""
    """Sentence that explains the status, or ""."""
    node: str = ""
    """Path of the node that caused the status, or ""."""
    items: ItemCounts = field(default_factory=ItemCounts)
    """Number of items by final state, from the ledger."""
    audit: Audit | None = None
    """Count of objects by ground-truth location, and whether the ledger agrees; NULL without ground truth."""
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    """Number of planned motions, and time for which skills waited for plans [s]."""
    ticks: int = 0
    """Number of control steps."""
    robot_time_s: float = 0.0
    """Duration on the run clock (simulated time in simulation, real time on hardware) [s]."""
    wall_time_s: float = 0.0
    """Duration on a wall clock [s]."""
    decision_hash: str = ""
    """Hash of all decisions."""
    run_directory: str = ""
    """Path of the run directory; "" if there is none."""
    crashes: int = 0
    """Number of worker processes that died during the run; after the first, the run was repeated."""

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
class ItemRow(Row):
    """An item of the ledger."""

    run_index: int
    """Index of the run."""
    item: str
    """Name of the item."""
    label: str
    """Class of the item."""
    state: str
    """Final state: placed, rejected, skipped, lost, or phantom (false positive: no such object)."""
    bin: str
    """Bin into which the item was placed, or ""."""
    failed_attempts: int
    """Number of failed attempts to pick the item."""
    robot_time_s: float
    """Time during which the item was the selected target and had no final state [s]."""


@dataclass(frozen=True, kw_only=True)
class SkillRow(Row):
    """All activations of one skill in a run."""

    run_index: int
    """Index of the run."""
    skill: str
    """Name of the skill."""
    activations: int
    """Number of activations."""
    failed_activations: int
    """Number of failed activations."""
    robot_time_s: float
    """Total duration of the activations [s]; the skills of parallel branches overlap."""


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
    """Return the rows of a run; values are rounded as in `result.json`.

    Args:
        run_index: Index of the run in the sweep.
        variant: Values of the varied params and keys of the cell, by name.
        result: Result of the run.
        timeline: Timeline of the run; it must keep its history (`has_history`).
    """
    values = {name: value for name, value in to_json(result).items() if name in RunRow.__dataclass_fields__}
    values |= {"decision_hash": result.trace, "run_directory": result.run}
    run = TypeAdapter(RunRow).validate_python({"run_index": run_index, "variant": variant, **values})
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
        failure_count = sum(activation.status == "FAILURE" for activation in activations)
        time = round(sum(activation.end - activation.start for activation in activations), DECIMAL_PLACES)
        counts = {"activations": len(activations), "failed_activations": failure_count}
        yield SkillRow(run_index=run_index, skill=skill, **counts, robot_time_s=time)
