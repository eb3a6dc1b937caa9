"""Report of a run: one HTML file that needs neither scripts nor anything else to be read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import cycle
from pathlib import Path

import yaml
from markupsafe import Markup

from executive.errors import ExecutiveError
from executive.perception.evidence import describe_unknown
from executive.record.atomic_file import write_atomically
from executive.record.diagnosis import text
from executive.record.pictures.palette import PALETTE
from executive.record.result import disagreement
from executive.record.run_directory import RunDirectory, convert_os_errors
from executive.record.timeline.activation import count_ends, find_last_failure, group_by_node
from executive.view.report.facts import ReportFacts
from executive.view.report.lanes import draw_lanes
from executive.view.report.shares import LOOK, RETRY, WAITING
from executive.view.terminal.summary import place_on_table
from executive.view.text import render
from executive.view.tree.svg import Note, svg

COLOURS = {LOOK: "#56B4E9", RETRY: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are no skill's; skills have the rest of the palette, in their order."""


def leave_report(run: str) -> tuple[str, str]:
    """Write the report of the run in a directory; return its file, or "" and the reason why there is none.

    Errors of the report do not change the end of the run.
    """
    try:
        return str(write_report(Path(run))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        return "", (
            f"no report was written: {type(error).__name__}: {error}; "
            f"`executive --debug report {run}` shows where"
        )


def write_report(path: Path) -> Path:
    """Write the report of the run in a directory, whole or not at all, and return its file.

    Raises:
        InputError: The directory lacks journal or tree, or cannot be written to.
    """
    file = RunDirectory(path).report
    page = report(ReportFacts(path))
    instead = "copy the run directory to where you may write, and have the report of the copy made"
    with convert_os_errors(f'write the report "{file}"', instead):
        write_atomically(file, page)
    return file


def report(facts: ReportFacts) -> str:
    """Return the report as HTML. Whatever a mission or a skill says in it is text, and never markup."""
    result, timeline = facts.result, facts.timeline
    story = None if result is None else result.story
    items = [item.item for item in facts.objects]
    params = facts.start.params
    rows = facts.shares.rows
    return render(
        "report/report.html",
        facts=facts,
        result=result,
        reason=_reason(facts),
        verdict=_verdict(facts),
        counts={} if result is None else asdict(result.items),
        audit=asdict(result.audit) if result is not None and result.audit is not None else {},
        unknown=describe_unknown({} if result is None else result.unknown),
        story=story,
        story_facts=[] if story is None else list(text.facts(story)),
        moment=next((each for each in facts.pictures if story and each.file == story.picture), None),
        titles={node.path: node.title for node in facts.nodes},
        place=place_on_table,
        colours=_colours(facts.shares.activities),
        sums={item: sum(spent.values()) for item, spent in rows.items()},
        tree=Markup(svg(facts.nodes, facts.start.mission, _notes(facts))),
        lanes=Markup(draw_lanes(timeline, facts.nodes)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
        other=[each for each in facts.pictures if each.reason and each.item not in items],
    )


def _reason(facts: ReportFacts) -> str:
    """Return the reason of the end, if the status does not say it already."""
    reason = "" if facts.ended is None else facts.ended.reason
    return "" if reason.upper() == facts.status else reason


def _verdict(facts: ReportFacts) -> str:
    """Return the end of the run in one sentence."""
    warning = "" if facts.result is None else disagreement(facts.result)
    return ". ".join(filter(None, (warning, _ending(facts))))


def _ending(facts: ReportFacts) -> str:
    result, ended = facts.result, facts.ended
    if ended is None:
        return "The record has no end: the run was killed, or goes on."
    if result is not None and result.story is not None:
        return result.story.verdict
    if ended.message:
        return ended.message
    if result is None:
        return "It came to its end; only the journal is left of its result."
    items = result.items
    if not items.seen:
        return "The mission was done; no object was seen."
    left = {"rejected": items.rejected, "skipped": items.skipped, "lost": items.lost}
    others = "".join(f", {number} {end}" for end, number in left.items() if number)
    return f"{items.placed} of {items.seen} objects are in their bins{others}."


def _colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity."""
    free = cycle(colour for colour in PALETTE if colour not in COLOURS.values())
    return {activity: COLOURS.get(activity) or next(free) for activity in activities}


def _notes(facts: ReportFacts) -> dict[str, Note]:
    """Return the note of each node in the picture of the tree."""
    return {
        path: Note(ran[-1].status, tuple(filter(None, (count_ends(ran), find_last_failure(ran)))))
        for path, ran in group_by_node(facts.timeline.activations).items()
    }
