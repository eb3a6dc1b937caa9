"""Rows of one run, computed from its result and its timeline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import pairwise

from pydantic import TypeAdapter

from executive.campaign.results.rows import ItemRow, PhaseRow, RunRecord, RunRow
from executive.cell.json_values import DECIMAL_PLACES, to_json
from executive.record.result import Result
from executive.record.timeline.timeline import Timeline


def make_record(job: int, variant: Mapping[str, str], result: Result, timeline: Timeline) -> RunRecord:
    """Return the rows of a run; values are rounded as in `result.json`.

    Args:
        job: Index of the run in the sweep.
        variant: Values of the varied params and keys of the cell, by name.
        result: Result of the run.
        timeline: Timeline of the run; its `has_history` is True.
    """
    values, names = to_json(result), {field.name for field in fields(RunRow)}
    shared_values = {name: value for name, value in values.items() if name in names}
    run = TypeAdapter(RunRow).validate_python({"job": job, "variant": variant, **shared_values})
    return RunRecord(run, tuple(_list_items(job, timeline)), tuple(_list_phases(job, timeline)))


def _list_items(job: int, timeline: Timeline) -> Iterator[ItemRow]:
    """Yield the row of each item."""
    for name, history in timeline.items.by_name.items():
        last = history.last_change
        yield ItemRow(
            job=job, item=name, label=last.label, state=last.state, bin=last.bin, attempts=last.attempts,
            robot_time_s=_measure_item_time(name, timeline),
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


def _list_phases(job: int, timeline: Timeline) -> Iterator[PhaseRow]:
    """Yield the row of each skill."""
    for skill in dict.fromkeys(activation.skill for activation in timeline.activations if activation.skill):
        activations = [activation for activation in timeline.activations if activation.skill == skill]
        failure_count = sum(activation.status == "FAILURE" for activation in activations)
        time = round(sum(activation.end - activation.start for activation in activations), DECIMAL_PLACES)
        counts = {"activations": len(activations), "failures": failure_count}
        yield PhaseRow(job=job, phase=skill, **counts, robot_time_s=time)
