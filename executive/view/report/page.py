"""Report of a run: one self-contained HTML file without scripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import cycle
from pathlib import Path

import yaml
from markupsafe import Markup

from executive.errors import ExecutiveError
from executive.perception.evidence import describe_unknown_labels
from executive.record.atomic_file import write_atomically
from executive.record.diagnosis.diagnosis_text import list_labelled_sentences
from executive.record.pictures.palette import PALETTE
from executive.record.run_directory import RunDirectory, convert_os_errors
from executive.record.timeline.activation import find_last_failure, format_counts, group_by_node
from executive.view.report.activity_times import FAILED_ATTEMPTS, LOOK, WAITING
from executive.view.report.lanes import draw_lanes
from executive.view.report.report_data import ReportData
from executive.view.terminal.summary import describe_place_on_table
from executive.view.text import render_template
from executive.view.tree.svg import NodeResult, make_svg

ACTIVITY_COLOURS = {LOOK: "#56B4E9", FAILED_ATTEMPTS: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are not skills; the colour of a skill is another colour of the palette."""


def try_write_report(run: str) -> tuple[str, str]:
    """Write the report of the run in the directory `run`; return file and error message, of which one is "".

    The function raises no exception, because an error of the report must not change the result of the run.
    """
    try:
        return str(write_report(Path(run))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        advice = f"`executive --debug report {run}` shows the traceback"
        return "", f"no report was written: {type(error).__name__}: {error}; {advice}"


def write_report(path: Path) -> Path:
    """Write the report of the run in the directory `path` atomically, and return the file of the report.

    Raises:
        InputError: The directory lacks the journal or the tree, or is not writable.
    """
    file = RunDirectory(path).report
    page = render_report(ReportData(path))
    advice = "copy the run directory to a writable folder, and write the report of the copy"
    with convert_os_errors(f'write the report "{file}"', advice):
        write_atomically(file, page)
    return file


def render_report(data: ReportData) -> str:
    """Return the report of a run as HTML; texts of missions and skills are escaped."""
    result, params, item_names = data.result, data.start.params, [item.item for item in data.items]
    # A reason that repeats the status, such as "fault", is omitted.
    reason = "" if data.end is None or data.end.reason.upper() == data.status else data.end.reason
    warning = "" if result is None else result.disagreement
    return render_template(
        "report/report.html",
        data=data,
        result=result,
        reason=reason,
        verdict=". ".join(filter(None, (warning, _describe_end(data)))),
        to_dict=asdict,
        describe_unknown_labels=describe_unknown_labels,
        list_labelled_sentences=list_labelled_sentences,
        titles={node.path: node.title for node in data.nodes},
        describe_place_on_table=describe_place_on_table,
        colours=_choose_colours(data.activity_times.activities),
        total_times={item: sum(row.values()) for item, row in data.activity_times.times_by_item.items()},
        tree=Markup(make_svg(data.nodes, data.start.mission, _make_node_results(data))),
        timeline=Markup(draw_lanes(data.timeline, data.nodes)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
        scan_pictures=[each for each in data.pictures if each.reason and each.item not in item_names],
    )


def _describe_end(data: ReportData) -> str:
    """Return a text about the end of the run: the verdict, the message, or the number of placed objects."""
    result, end = data.result, data.end
    if end is None:
        return "The journal has no end: the run was killed, or is still running."
    if verdict := end.message if result is None else result.verdict:
        return verdict
    if result is None:
        return "The run ended, but its result.json is missing."
    items = result.items
    if not items.seen:
        return "The mission succeeded; no object was seen."
    unplaced_counts = {"rejected": items.rejected, "skipped": items.skipped, "lost": items.lost}
    unplaced_text = "".join(f", {count} {state}" for state, count in unplaced_counts.items() if count)
    return f"{items.placed} of {items.seen} objects are in their bins{unplaced_text}."


def _choose_colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity as `#rrggbb`."""
    skill_colours = cycle(colour for colour in PALETTE if colour not in ACTIVITY_COLOURS.values())
    return {activity: ACTIVITY_COLOURS.get(activity) or next(skill_colours) for activity in activities}


def _make_node_results(data: ReportData) -> dict[str, NodeResult]:
    """Return the result of each node that ran, by node path."""
    results = {}
    for path, activations in group_by_node(data.timeline.activations).items():
        lines = tuple(filter(None, (format_counts(activations), find_last_failure(activations))))
        results[path] = NodeResult(activations[-1].status, lines)
    return results
