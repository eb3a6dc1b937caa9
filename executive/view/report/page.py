"""The report of a run: one HTML file that needs neither scripts nor anything else to be read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from executive.record.pictures.palette import PALETTE
from executive.record.run_directory import RunDirectory, refused
from executive.record.whole_file import write_whole
from executive.view import story
from executive.view.items import Row
from executive.view.report.course import tallies
from executive.view.report.facts import Facts, gather
from executive.view.report.lanes import timeline
from executive.view.report.pictures import Picture
from executive.view.report.shares import LOOK, NOBODY, RETRY, WAITING
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
        spent: Time by activity [s].
    """

    row: Row
    picture: Picture | None
    failures: Sequence[tuple[float, str, str]]
    pictures: Sequence[Picture]
    spent: Mapping[str, float]


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
        raise refused(f'write the report "{file}"', error) from error
    return file


def report(facts: Facts) -> str:
    """Return the report as HTML. Whatever a mission or a skill says in it is text, and never markup."""
    environment = Environment(
        loader=PackageLoader("executive.view.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["sum_of"] = lambda spent: sum(spent.values())
    told = facts.result.get("story")
    return environment.get_template("report.html").render(
        facts=facts,
        verdict=_verdict(facts),
        story=told,
        story_facts=list(story.facts(told)) if told else [],
        moment=next(
            (seen for seen in facts.pictures.failures if told and seen.file == told["picture"]), None
        ),
        objects=list(_objects(facts)),
        rest=facts.shares.rows.get(NOBODY, {}),
        colours=_colours(facts.shares.activities),
        tree=Markup(svg(facts.nodes, facts.start["mission"], _notes(facts))),
        timeline=Markup(timeline(facts.course, facts.nodes, facts.end)),
        params=yaml.safe_dump(dict(facts.start["params"]), sort_keys=False) if facts.start["params"] else "",
        inputs=[
            name for name in ("mission.yaml", "params.yaml", "cell.yaml") if (facts.path / name).exists()
        ],
        other=[picture for picture in facts.pictures.failures if not picture.item],
    )


def _verdict(facts: Facts) -> str:
    """Return how the run ended, in one sentence."""
    told = facts.result.get("story")
    if told:
        return str(told["verdict"])
    if not facts.result:
        return "The record has no end: the run was killed, or goes on."
    books: Mapping[str, Any] = facts.result.get("items") or {}
    if not books:
        return str(facts.result["message"])
    left = {fate: books[fate] for fate in ("rejected", "lost") if books[fate]}
    said = "".join(f", {number} {fate}" for fate, number in left.items())
    return f"{books['placed']} of {books['seen']} objects are in their bins{said}."


def _objects(facts: Facts) -> Iterator[Object]:
    names = {node.path: node.title for node in facts.nodes}
    for row in facts.objects:
        failures = [
            (span.ended, f"{names[span.node]}.{span.reason}", span.message)
            for span in facts.course
            if span.item == row.item and span.status == "FAILURE"
        ]
        seen = [picture for picture in facts.pictures.failures if picture.item == row.item]
        spent = facts.shares.rows.get(row.item, {})
        yield Object(row, facts.pictures.decisions.get(row.item), failures, seen, spent)


def _colours(activities: Sequence[str]) -> dict[str, str]:
    """Return the colour of each activity."""
    free = iter([colour for colour in PALETTE if colour not in COLOURS.values()] * len(activities))
    return {activity: COLOURS.get(activity) or next(free) for activity in activities}


def _notes(facts: Facts) -> dict[str, Note]:
    """Return what the picture of the tree says of each node."""
    return {
        path: Note(tally.status, tuple(filter(None, (tally.counts, tally.said))))
        for path, tally in tallies(facts.course).items()
    }
