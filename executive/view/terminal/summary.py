"""Texts about a run for the terminal: command to repeat the run, summary, and outcomes of the items."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from executive.events import ItemChanged
from executive.perception.evidence import describe_unknown_labels
from executive.record.diagnosis import format_diagnosis, make_resume_command, wrap_lines
from executive.record.result import Result


def format_repeat_command(
    mission: str, seed: int, overrides: Mapping[str, object], requests: Iterable[str] = (),
    scene: Path | None = None,
) -> str:  # fmt: skip
    """Return the command line that repeats a run exactly.

    `overrides` contains the params from the command line by name; `requests` are made by the operator.
    """
    arguments = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        arguments += ["--set", f"{key}={value}"]
    for request in requests:
        arguments += ["--request", request]
    arguments += [] if scene is None else ["--scene", str(scene)]
    return shlex.join(arguments)


def describe_end(status: str, reason: str, node: str, message: str) -> str:
    """Return a line about the end of a run: status, reason, node path and message, without empty parts."""
    # The reason of a fault or a halt repeats the status, and is omitted.
    reason_text = f" {reason}" if reason and reason.upper() != status else ""
    node_text = f" at {node}" if node else ""
    message_text = f": {message}" if message else ""
    return f"{status}{reason_text}{node_text}{message_text}"


def format_summary(
    result: Result, items: Collection[ItemChanged], repeat_command: str, report_file: str = ""
) -> str:
    """Return a text with the end of a run, the times, and the items by bin or by state.

    The diagnosis of a run that did not succeed is at the end, because users read the last lines first.
    `items` contains the last change of each item; `report_file` is "" if there is no report.
    """
    times = f"{result.robot_time_s:.1f} s on the robot's clock, {result.wall_time_s:.1f} s by the wall clock"
    groups = sorted(group_items_by_outcome(items).items())
    outcomes = [f"  {outcome}: {', '.join(names)}" for outcome, names in groups]
    if labels_text := describe_unknown_labels(result.unknown_labels):
        outcomes.append(f"  {labels_text}")
    outcomes += [f"  detector error rates are assumed: {reason}" for reason in result.assumption_reasons]
    warning = wrap_lines(result.disagreement, "", "  ", max_lines=3)
    if result.diagnosis is not None:
        diagnosis = format_diagnosis(result.diagnosis, result.run, repeat_command, report_file)
        lines = [times, *outcomes, "", *diagnosis]
    else:
        end = describe_end(result.status, result.reason, result.node, result.message)
        lines = [end, times, f"{result.run}  (repeat: {repeat_command})", *outcomes]
        lines += [f"report: {report_file}"] if report_file else []
        if result.status == "INCOMPLETE":
            lines.append(f"after you have moved the remaining objects: {make_resume_command(result.run)}")
    return "\n".join([*warning, *lines]) + "\n"


def describe_place_on_table(item: ItemChanged) -> str:
    """Return the position of an item that was rejected or skipped, as text; "" for other items."""
    is_on_table = item.state in ("rejected", "skipped")
    return "x {:.2f} m, y {:.2f} m".format(*item.position) if is_on_table else ""


def group_items_by_outcome(items: Collection[ItemChanged]) -> dict[str, list[str]]:
    """Return names of placed items by bin, and descriptions of the other items by state.

    Phantoms, which are detections without an object, are only counted.
    """
    outcomes: dict[str, list[str]] = defaultdict(list)
    for item in items:
        if item.state == "placed":
            outcomes[item.bin].append(item.item)
        elif item.state != "phantom":
            details = ": ".join(filter(None, (describe_place_on_table(item), item.reason)))
            outcomes[item.state].append(f"{item.item} ({details})" if details else item.item)
    if phantom_count := sum(item.state == "phantom" for item in items):
        outcomes["phantom"].append(f"{phantom_count} detected by mistake")
    return dict(outcomes)
