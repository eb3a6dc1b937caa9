"""Last lines of a run on a terminal: its end, its times, its items, and the explanation of a failure."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.perception.evidence import describe_unknown
from executive.record.result import disagreement
from executive.view.items import ItemTable

WIDTH = 110
"""Length at which long lines are wrapped [columns]."""

NODES = 5
"""Nodes of the way down that are shown; beyond that, those next to the root are left out."""

_READS = 3
_LOST = 3
_LABEL = 12
_UNIT = re.compile(r"(?<=[0-9)]) (?=(?:s|m)\b)")
_JOINED = "\N{NO-BREAK SPACE}"


def repeat_command(
    mission: str,
    seed: int,
    overrides: Mapping[str, str],
    requests: Iterable[str] = (),
    scene: Path | None = None,
) -> str:
    """Return the command line that repeats a run exactly.

    Args:
        mission: Its name or file.
        seed: Its seed.
        overrides: Params and keys of the cell as given on the command line.
        requests: What the operator asked for.
        scene: Its scene file, or None.
    """
    words = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        words += ["--set", f"{key}={value}"]
    for request in requests:
        words += ["--request", request]
    words += [] if scene is None else ["--scene", str(scene)]
    return shlex.join(words)


def resume_command(run: str) -> str:
    """Return the command line that resumes the run in a directory."""
    return shlex.join(["executive", "run", "--resume", run])


def verdict(result: Mapping[str, Any]) -> str:
    """Return how a run ended in one line: status, reason, node and sentence."""
    # The reason of a fault or a halt is the status once more.
    told = result["reason"] and result["reason"].upper() != result["status"]
    reason = f" {result['reason']}" if told else ""
    where = f" at {result['node']}" if result["node"] else ""
    why = f": {result['message']}" if result["message"] else ""
    return f"{result['status']}{reason}{where}{why}"


def summary(result: Mapping[str, Any], items: ItemTable, repeat: str, report: str = "") -> str:
    """Return how a run ended, how long it took, and a line for each bin and each other end of an item.

    `report` is the file of its report, or "". What did not succeed ends with its story instead: the last
    lines on a terminal are read first.
    """
    robot, wall = result["robot_time_s"], result["wall_time_s"]
    times = f"{robot:.1f} s on the robot's clock, {wall:.1f} s by the wall clock"
    fates = [f"  {fate}: {', '.join(names)}" for fate, names in sorted(items.by_fate().items())]
    if unknown := describe_unknown(result.get("unknown", {})):
        fates.append(f"  {unknown}")
    fates += [f"  assumed error rates: {doubt}" for doubt in result.get("doubts", ())]
    story = result.get("story")
    warning = _wrapped(disagreement(result), "", "  ", most=3)
    if story is not None:
        lines = [times, *fates, "", *story_lines(story, result["run"], repeat, report)]
    else:
        lines = [verdict(result), times, f"{result['run']}  (repeat: {repeat})", *fates]
        lines += [f"report: {report}"] if report else []
        if result["status"] == "INCOMPLETE":
            lines.append(f"after you have moved them: {resume_command(result['run'])}")
    return "\n".join([*warning, *lines]) + "\n"


def story_lines(story: Mapping[str, Any], run: str, repeat: str, report: str = "") -> list[str]:
    """Return the story of a run, the most important first.

    Args:
        story: As `executive.record.diagnosis.diagnosis.Story.tell` returns it.
        run: The run directory.
        repeat: The command that repeats the run. Commands are never wrapped, so that they can be copied.
        report: File of its report, or "".
    """
    lines = _wrapped(f"{story['status']} after {story['clock']:.2f} s: {story['verdict']}", "", "  ", most=3)
    lines += _way_down(story)
    for label, text in facts(story):
        lines += _wrapped(text, f"{label:{_LABEL}}", " " * _LABEL, most=3)
    commands = {"record": run, "report": report, "repeat": repeat}
    if story["resumes"]:
        commands["go on"] = resume_command(run)
    return lines + [f"{label:{_LABEL}}{command}" for label, command in commands.items() if command]


def facts(story: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the other facts of a story: a word, and a sentence."""
    node = story["node"]
    if node is not None and not any(link["why"] for link in story["chain"]):
        yield "where", f"{node['path']} ({node['place']})"
    if story["raised_at"]:
        whole = '; the whole traceback is in the journal, event "fault"' if story["recorded"] else ""
        yield "raised at", story["raised_at"] + whole
    if story["reads"]:
        yield "the cell", ", ".join(_read(sense, story["verdict"]) for sense in story["reads"][:_READS])
    for lost in story["lost"][:_LOST]:
        yield "lost", _lost(lost)
    # Of lost items the last look is among the facts already.
    if not story["lost"]:
        yield "last look", _look(story["look"])
    if story["picture"]:
        yield "picture", story["picture"]
    holds = {"": "is empty", "something": "holds something that nobody knows"}
    arm = "the arm is at rest" if story["arm"] == "at rest" else f"the arm: {story['arm']}"
    yield "now", f"{arm}, the tool {holds.get(story['holds'], 'holds ' + story['holds'])}"
    if story["left"]:
        yield "left to do", f"{len(story['left'])}: {', '.join(story['left'])}"
    for sentence in story["next"]:
        yield "next", sentence


def _way_down(story: Mapping[str, Any]) -> list[str]:
    """Return a line for each node that did not stop the failure, and one for the node that decided."""
    here = f"{story['mission']}:"
    told = [(link["name"], link["why"], link["place"]) for link in story["chain"] if link["why"]]
    if not told:
        return []
    above = f", {len(told) - NODES} nodes above left out" if len(told) > NODES else ""
    node = story["node"]
    shown = [*told[-NODES:], (node["name"], node["path"], node["place"])]
    width = max(len(name) for name, _, _ in shown)
    lines = [f"why nothing in {story['mission']} stopped it, from the root down{above}:"]
    for name, why, place in shown:
        line = f"line {place.removeprefix(here)}" if place.startswith(here) else place
        lines += _wrapped(f"{why} ({line})", f"  {name:{width}}  ", " " * (width + 4))
    return lines


def _wrapped(text: str, first: str, others: str, *, most: int = 2) -> list[str]:
    """Return a text in at most so many lines that are not too long; no number is parted from its unit."""
    lines = textwrap.wrap(
        _UNIT.sub(_JOINED, text), WIDTH, initial_indent=first, subsequent_indent=others, max_lines=most,
        placeholder=" ...", break_on_hyphens=False,
    )  # fmt: skip
    return [line.replace(_JOINED, " ") for line in lines]


def _read(sense: Mapping[str, Any], verdict: str) -> str:
    """Return an answer of the cell; the text of an exception only where the verdict lacks it."""
    name, value, when = sense["name"], sense["value"], f"({sense['clock']:.2f} s)"
    if sense["raised"]:
        text = "" if value in verdict else f": {value}"
        return f"{name} raised {sense['raised']} {when}{text}"
    return f"{name} = {value:g} {when}" if isinstance(value, float) else f"{name} = {value} {when}"


def _look(look: Mapping[str, Any] | None) -> str:
    if look is None:
        return "none so far"
    where = f"frame {look['frame']}, camera {look['camera']}, by {look['detector']}, at {look['clock']:.2f} s"
    if "item" not in look:
        return f"{where}: {_counted(look['found'], 'box', 'boxes')}"
    seen = "" if look["confidence"] is None else f" as {look['label']} {look['confidence']:.2f}"
    known = f"{_counted(look['looks'], 'look')}, {_counted(look['attempts'], 'failed attempt')} in all"
    return f"{look['item']}{seen}{_at(look['position'])}: {where}; {known}"


def _lost(lost: Mapping[str, Any]) -> str:
    look, failed, dropped = lost["look"], lost["failed"], lost["dropped"]
    told = [lost["item"]]
    if look is not None:
        told[0] += f" seen last{_at(look['position'])} at {look['clock']:.2f} s"
        told[0] += f", not in the {_counted(lost['unseen'], 'look')} since"
    if dropped is not None and (failed is None or failed["clock"] != dropped):
        told.append(f"dropped at {dropped:.2f} s")
    if failed is not None:
        told.append(f"{failed['what']} at {failed['clock']:.2f} s: {failed['message']}")
    return "; ".join(told)


def _at(position: Sequence[float] | None) -> str:
    return "" if position is None else " at ({:.3f}, {:.3f}, {:.3f}) m".format(*position)


def _counted(count: int, one: str, many: str = "") -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"
