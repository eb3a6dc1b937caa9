"""Summary of a run on a terminal: its end, its times, its items, and the explanation of a failure."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from executive.events import ItemChanged
from executive.perception.evidence import describe_unknown_labels
from executive.record.diagnosis.diagnosis_text import format_diagnosis, make_resume_command, wrap_lines
from executive.record.result import Result, describe_disagreement


def format_repeat_command(
    mission: str,
    seed: int,
    overrides: Mapping[str, object],
    requests: Iterable[str] = (),
    scene: Path | None = None,
) -> str:
    """Return the command line that repeats a run exactly.

    Args:
        mission: Name or file of the mission.
        seed: Seed of the run.
        overrides: Params that were given on the command line, by name.
        requests: Requests of the operator, in order.
        scene: Scene file of the run, or None.
    """
    words = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        words += ["--set", f"{key}={value}"]
    for request in requests:
        words += ["--request", request]
    words += [] if scene is None else ["--scene", str(scene)]
    return shlex.join(words)


def describe_end(status: str, reason: str, node: str, message: str) -> str:
    """Return status, reason, path of the node, and message in one line; empty arguments are omitted."""
    # The reason of a fault or a halt is not written, because it repeats the status.
    reason_text = f" {reason}" if reason and reason.upper() != status else ""
    node_text = f" at {node}" if node else ""
    message_text = f": {message}" if message else ""
    return f"{status}{reason_text}{node_text}{message_text}"


def format_summary(
    result: Result, items: Iterable[ItemChanged], repeat_command: str, report: str = ""
) -> str:
    """Return a text with the end of a run, its times, and its items by bin or by state.

    The diagnosis of a run that did not succeed is at the end, because users read the last lines first.

    Args:
        result: Result of the run.
        items: Last change of each item.
        repeat_command: The command that repeats the run.
        report: File of the report, or "".
    """
    times = f"{result.robot_time_s:.1f} s on the robot's clock, {result.wall_time_s:.1f} s by the wall clock"
    groups = sorted(group_items_by_outcome(items).items())
    outcomes = [f"  {outcome}: {', '.join(names)}" for outcome, names in groups]
    if unknown := describe_unknown_labels(result.unknown_labels):
        outcomes.append(f"  {unknown}")
    outcomes += [f"  assumed error rates: {doubt}" for doubt in result.assumption_reasons]
    warning = wrap_lines(describe_disagreement(result), "", "  ", max_lines=3)
    if result.diagnosis is not None:
        diagnosis = format_diagnosis(result.diagnosis, result.run, repeat_command, report)
        lines = [times, *outcomes, "", *diagnosis]
    else:
        end = describe_end(result.status, result.reason, result.node, result.message)
        lines = [end, times, f"{result.run}  (repeat: {repeat_command})", *outcomes]
        lines += [f"report: {report}"] if report else []
        if result.status == "INCOMPLETE":
            lines.append(f"after you have moved the remaining objects: {make_resume_command(result.run)}")
    return "\n".join([*warning, *lines]) + "\n"


def describe_place_on_table(item: ItemChanged) -> str:
    """Return a text with the position of an item that was left on the table; "" for other items."""
    is_left = item.state in ("rejected", "skipped")
    return "x {:.2f} m, y {:.2f} m".format(*item.position) if is_left else ""


def group_items_by_outcome(items: Iterable[ItemChanged]) -> dict[str, list[str]]:
    """Return the placed items by bin, and texts about the other items (with position and reason) by state.

    Phantoms, which are detections without an object, are only counted.
    """
    outcomes: dict[str, list[str]] = defaultdict(list)
    phantom_count = 0
    for item in items:
        if item.state == "phantom":
            phantom_count += 1
        elif item.state == "placed":
            outcomes[item.bin].append(item.item)
        else:
            details = ": ".join(filter(None, (describe_place_on_table(item), item.reason)))
            outcomes[item.state].append(f"{item.item} ({details})" if details else item.item)
    if phantom_count:
        outcomes["phantom"].append(f"{phantom_count} seen by mistake")
    return dict(outcomes)
