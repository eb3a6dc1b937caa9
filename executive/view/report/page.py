"""Report of a run: one HTML file that needs neither scripts nor anything else to be read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import yaml
from markupsafe import Markup

from executive.errors import ExecutiveError
from executive.perception.evidence import describe_unknown
from executive.record.pictures.palette import PALETTE
from executive.record.result import disagreement
from executive.record.run_directory import RunDirectory, refusing
from executive.record.whole_file import write_whole
from executive.view.report.course import by_node, counts, last_failure
from executive.view.report.facts import Facts
from executive.view.report.lanes import timeline
from executive.view.report.shares import LOOK, RETRY, WAITING
from executive.view.terminal import summary
from executive.view.text import render
from executive.view.tree.svg import Note, svg

COLOURS = {LOOK: "#56B4E9", RETRY: "#D55E00", WAITING: "#9aa5b4"}
"""Colours of the activities that are no skill's; skills have the rest of the palette, in their order."""


def leave_report(result: Mapping[str, Any]) -> tuple[str, str]:
    """Write the report of a run that has just ended; return its file, or "" and why there is none.

    Whatever goes wrong with it, the run ended as it did.
    """
    try:
        return str(write_report(Path(result["run"]))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        return "", (
            f"no report was written: {type(error).__name__}: {error}; "
            f"`executive --debug report {result.get('run', 'RUN')}` shows where"
        )


def write_report(path: Path) -> Path:
    """Write the report of the run in a directory, whole or not at all, and return its file.

    Raises:
        InputError: The directory lacks journal or tree, or cannot be written to.
    """
    file = RunDirectory(path).report
    text = report(Facts(path))
    instead = "copy the run directory to where you may write, and have the report of the copy made"
    with refusing(f'write the report "{file}"', instead):
        write_whole(file, text)
    return file


def report(facts: Facts) -> str:
    """Return the report as HTML. Whatever a mission or a skill says in it is text, and never markup."""
    told = facts.result.get("story")
    items = [row.item for row in facts.objects]
    params = facts.start.params
    rows = facts.shares.rows
    return render(
        "report/report.html",
        facts=facts,
        verdict=_verdict(facts),
        unknown=describe_unknown(facts.result.get("unknown", {})),
        story=told,
        story_facts=list(summary.facts(told)) if told else [],
        moment=next((each for each in facts.pictures if told and each.file == told["picture"]), None),
        titles={node.path: node.title for node in facts.nodes},
        colours=_colours(facts.shares.activities),
        sums={item: sum(spent.values()) for item, spent in rows.items()},
        tree=Markup(svg(facts.nodes, facts.start.mission, _notes(facts))),
        timeline=Markup(timeline(facts.course, facts.nodes, facts.end)),
        params=yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else "",
        other=[each for each in facts.pictures if each.reason and each.item not in items],
    )


def _verdict(facts: Facts) -> str:
    """Return how the run ended, in one sentence."""
    warning = disagreement(facts.result)
    return f"{warning}. {_ending(facts)}" if warning else _ending(facts)


def _ending(facts: Facts) -> str:
    told = facts.result.get("story")
    if told:
        return str(told["verdict"])
    if not facts.result:
        return "The record has no end: the run was killed, or goes on."
    if facts.result.get("message"):
        return str(facts.result["message"])
    books: Mapping[str, Any] | None = facts.result.get("items")
    if books is None:
        return "It came to its end; only the journal is left of its result."
    if not books["seen"]:
        return "The mission was done; no object was seen."
    left = {state: books[state] for state in ("rejected", "skipped", "lost") if books.get(state)}
    said = "".join(f", {number} {fate}" for fate, number in left.items())
    return f"{books['placed']} of {books['seen']} objects are in their bins{said}."


def _colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity."""
    free = cycle(colour for colour in PALETTE if colour not in COLOURS.values())
    return {activity: COLOURS.get(activity) or next(free) for activity in activities}


def _notes(facts: Facts) -> dict[str, Note]:
    """Return the note of each node in the picture of the tree."""
    return {
        path: Note(ran[-1].status, tuple(filter(None, (counts(ran), last_failure(ran)))))
        for path, ran in by_node(facts.course).items()
    }
