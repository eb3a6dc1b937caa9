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
from executive.record.diagnosis import diagnosis_text
from executive.record.pictures.palette import PALETTE
from executive.record.result import describe_disagreement
from executive.record.run_directory import RunDirectory, convert_os_errors
from executive.record.timeline.activation import describe_ends, find_last_failure, group_by_node
from executive.view.report.activity_times import LOOK, RETRY, WAITING
from executive.view.report.facts import ReportFacts
from executive.view.report.lanes import draw_lanes
from executive.view.terminal.summary import describe_place_on_table
from executive.view.text import render_template
from executive.view.tree.svg import NodeNote, draw_svg

ACTIVITY_COLOURS = {LOOK: "#56B4E9", RETRY: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are not skills; skills have the other colours of the palette, in order."""


def try_write_report(run: str) -> tuple[str, str]:
    """Write the report of the run in the directory `run`; return the file and "", or "" and an error message.

    The function raises no exception, because an error of the report must not change the result of the run.
    """
    try:
        return str(write_report(Path(run))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        return "", (
            f"no report was written: {type(error).__name__}: {error}; "
            f"`executive --debug report {run}` shows the traceback"
        )


def write_report(path: Path) -> Path:
    """Write the report of the run in a directory atomically, and return the file of the report.

    Raises:
        InputError: The directory lacks the journal or the tree, or is not writable.
    """
    file = RunDirectory(path).report
    page = render_report(ReportFacts(path))
    remedy = "copy the run directory to a writable folder, and write the report of the copy"
    with convert_os_errors(f'write the report "{file}"', remedy):
        write_atomically(file, page)
    return file


def render_report(facts: ReportFacts) -> str:
    """Return the report as HTML; texts of missions and skills are escaped."""
    result, timeline = facts.result, facts.timeline
    diagnosis = None if result is None else result.diagnosis
    item_names = [item.item for item in facts.objects]
    params = facts.start.params
    return render_template(
        "report/report.html",
        facts=facts,
        result=result,
        reason=_get_reason(facts),
        verdict=_describe_end(facts),
        counts={} if result is None else asdict(result.items),
        audit=asdict(result.audit) if result is not None and result.audit is not None else {},
        unknown=describe_unknown_labels({} if result is None else result.unknown_labels),
        diagnosis=diagnosis,
        diagnosis_facts=[] if diagnosis is None else list(diagnosis_text.list_labelled_sentences(diagnosis)),
        last_picture=next(
            (picture for picture in facts.pictures if diagnosis and picture.file == diagnosis.picture), None
        ),
        titles={node.path: node.title for node in facts.nodes},
        describe_place=describe_place_on_table,
        colours=_choose_colours(facts.activity_times.activities),
        totals={item: sum(row.values()) for item, row in facts.activity_times.times_by_item.items()},
        tree=Markup(draw_svg(facts.nodes, facts.start.mission, _make_notes(facts))),
        lanes=Markup(draw_lanes(timeline, facts.nodes)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
        other_pictures=[each for each in facts.pictures if each.reason and each.item not in item_names],
    )


def _get_reason(facts: ReportFacts) -> str:
    """Return the reason of the end of the run; "" if there is none or it repeats the status."""
    reason = "" if facts.end is None else facts.end.reason
    return "" if reason.upper() == facts.status else reason


def _describe_end(facts: ReportFacts) -> str:
    """Return a text about the end of the run, after a warning if ledger and audit disagree."""
    warning = "" if facts.result is None else describe_disagreement(facts.result)
    return ". ".join(filter(None, (warning, _describe_status(facts))))


def _describe_status(facts: ReportFacts) -> str:
    result, end = facts.result, facts.end
    if end is None:
        return "The journal has no end: the run was killed, or is still running."
    if result is not None and result.diagnosis is not None:
        return result.diagnosis.verdict
    if end.message:
        return end.message
    if result is None:
        return "The run ended, but its result.json is missing."
    items = result.items
    if not items.seen:
        return "The mission succeeded; no object was seen."
    other_counts = {"rejected": items.rejected, "skipped": items.skipped, "lost": items.lost}
    others = "".join(f", {count} {state}" for state, count in other_counts.items() if count)
    return f"{items.placed} of {items.seen} objects are in their bins{others}."


def _choose_colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity."""
    skill_colours = cycle(colour for colour in PALETTE if colour not in ACTIVITY_COLOURS.values())
    return {activity: ACTIVITY_COLOURS.get(activity) or next(skill_colours) for activity in activities}


def _make_notes(facts: ReportFacts) -> dict[str, NodeNote]:
    """Return the note of each node that ran, for the drawing of the tree."""
    return {
        path: NodeNote(
            group[-1].status, tuple(filter(None, (describe_ends(group), find_last_failure(group))))
        )
        for path, group in group_by_node(facts.timeline.activations).items()
    }
