"""The report of a run: one HTML file that needs neither scripts nor anything else to be read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from executive.errors import InputError
from executive.record.pictures.palette import PALETTE
from executive.record.run_directory import NO_ROOM, RunDirectory
from executive.record.whole_file import write_whole
from executive.view import story
from executive.view.items import Row
from executive.view.report.course import tallies
from executive.view.report.facts import Facts, gather
from executive.view.report.lanes import timeline
from executive.view.report.pictures import Picture
from executive.view.report.shares import LOOK, RETRY, WAITING
from executive.view.text import writable
from executive.view.tree.svg import Note, svg

COLOURS = {LOOK: "#56B4E9", RETRY: "#D55E00", WAITING: "#9aa5b4"}
"""Of the activities that are no skill's; skills have the rest of the palette, in their order."""


@dataclass(frozen=True)
class Object:
    """One object of a run.

    Attributes:
        row: What became of it.
        picture: What the last decision for it was made from, or None.
        failures: What went wrong with it: when [s], what, why.
        pictures: Of that.
    """

    row: Row
    picture: Picture | None
    failures: Sequence[tuple[float, str, str]]
    pictures: Sequence[Picture]


def write_report(path: Path) -> Path:
    """Write the report of the run in a directory, whole or not at all, and return its file.

    Raises:
        InputError: The directory lacks journal or tree, or cannot be written to.
    """
    file = RunDirectory(path).report
    text = report(gather(path))
    try:
        write_whole(file, text)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        space = "free some space or " if error.errno in NO_ROOM else ""
        raise InputError(
            f'cannot write the report "{file}": {reason}; {space}copy the run directory to where you may '
            "write, and have the report of the copy made"
        ) from error
    return file


def report(facts: Facts) -> str:
    """Return the report as HTML. Whatever a mission or a skill says in it is text, and never markup."""
    environment = Environment(
        loader=PackageLoader("executive.view", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["sum_of"] = lambda spent: sum(spent.values())
    told = facts.result.get("story")
    objects = list(_objects(facts))
    seen = [*facts.pictures.decisions.values(), *facts.pictures.failures]
    text = environment.get_template("report/report.html").render(
        facts=facts,
        verdict=_verdict(facts),
        story=told,
        story_facts=list(story.facts(told)) if told else [],
        moment=next((picture for picture in seen if told and picture.file == told["picture"]), None),
        objects=objects,
        colours=_colours(facts.shares.activities),
        tree=Markup(svg(facts.nodes, facts.start["mission"], _notes(facts))),
        timeline=Markup(timeline(facts.course, facts.nodes, facts.end)),
        params=_yaml(facts.start["params"]),
        other=[
            picture
            for picture in facts.pictures.failures
            if picture.item not in {object.row.item for object in objects}
        ],
    )
    # A file name that is not UTF-8 may stand in it.
    return writable(text)


def _yaml(params: Mapping[str, Any]) -> str:
    return yaml.safe_dump(dict(params), sort_keys=False, allow_unicode=True) if params else ""


def _verdict(facts: Facts) -> str:
    """Return how the run ended, in one sentence."""
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
    left = {fate: books[fate] for fate in ("rejected", "lost") if books[fate]}
    said = "".join(f", {number} {fate}" for fate, number in left.items())
    return f"{books['placed']} of {books['seen']} objects are in their bins{said}."


def _objects(facts: Facts) -> Iterator[Object]:
    names = {node.path: node.title for node in facts.nodes}
    for row in facts.objects:
        failures = [
            (span.ended, f"{names.get(span.node, span.node)}.{span.reason}", span.message)
            for span in facts.course
            if span.item == row.item and span.status == "FAILURE"
        ]
        seen = [picture for picture in facts.pictures.failures if picture.item == row.item]
        yield Object(row, facts.pictures.decisions.get(row.item), failures, seen)


def _colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity."""
    free = cycle(colour for colour in PALETTE if colour not in COLOURS.values())
    return {activity: COLOURS.get(activity) or next(free) for activity in activities}


def _notes(facts: Facts) -> dict[str, Note]:
    """Return what the picture of the tree says of each node."""
    return {
        path: Note(tally.status, tuple(filter(None, (tally.counts, tally.said))))
        for path, tally in tallies(facts.course).items()
    }
