"""Last lines of a run on a terminal: its end, its times, its items, and the explanation of a failure."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from executive.events import ItemChanged
from executive.perception.evidence import describe_unknown
from executive.record.diagnosis.text import diagnosis_lines, resume_command, wrap_lines
from executive.record.result import Result, describe_disagreement


def repeat_command(
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
        overrides: Params as given on the command line.
        requests: Requests of the operator.
        scene: The scene file, or None.
    """
    words = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        words += ["--set", f"{key}={value}"]
    for request in requests:
        words += ["--request", request]
    words += [] if scene is None else ["--scene", str(scene)]
    return shlex.join(words)


def verdict(status: str, reason: str, node: str, message: str) -> str:
    """Return the end of a run in one line."""
    # The reason of a fault or a halt repeats the status.
    reason = f" {reason}" if reason and reason.upper() != status else ""
    where = f" at {node}" if node else ""
    why = f": {message}" if message else ""
    return f"{status}{reason}{where}{why}"


def summary(result: Result, items: Iterable[ItemChanged], repeat: str, report: str = "") -> str:
    """Return the end of a run, its times, and a line for each bin and each other end of an item.

    The diagnosis of a run that did not succeed is at the end, because users read the last lines first.

    Args:
        result: Result of the run.
        items: Last change of each item.
        repeat: The command that repeats the run.
        report: File of the report, or "".
    """
    robot, wall = result.robot_time_s, result.wall_time_s
    times = f"{robot:.1f} s on the robot's clock, {wall:.1f} s by the wall clock"
    ends = [f"  {end}: {', '.join(names)}" for end, names in sorted(items_by_end(items).items())]
    if unknown := describe_unknown(result.unknown):
        ends.append(f"  {unknown}")
    ends += [f"  assumed error rates: {doubt}" for doubt in result.doubts]
    warning = wrap_lines(describe_disagreement(result), "", "  ", max_lines=3)
    if result.story is not None:
        lines = [times, *ends, "", *diagnosis_lines(result.story, result.run, repeat, report)]
    else:
        ended = verdict(result.status, result.reason, result.node, result.message)
        lines = [ended, times, f"{result.run}  (repeat: {repeat})", *ends]
        lines += [f"report: {report}"] if report else []
        if result.status == "INCOMPLETE":
            lines.append(f"after you have moved them: {resume_command(result.run)}")
    return "\n".join([*warning, *lines]) + "\n"


def place_on_table(item: ItemChanged) -> str:
    """Return the place of an item that was left on the table in words, else ""."""
    is_left = item.state in ("rejected", "skipped")
    return "x {:.2f} m, y {:.2f} m".format(*item.position) if is_left else ""


def items_by_end(items: Iterable[ItemChanged]) -> dict[str, list[str]]:
    """Return the items by bin, and those that are in no bin by state with place and reason.

    Phantoms are only counted, because they are no objects.
    """
    ends: dict[str, list[str]] = defaultdict(list)
    phantoms = 0
    for item in items:
        if item.state == "phantom":
            phantoms += 1
        elif item.state == "placed":
            ends[item.bin].append(item.item)
        else:
            place_and_reason = ": ".join(filter(None, (place_on_table(item), item.why)))
            ends[item.state].append(f"{item.item} ({place_and_reason})" if place_and_reason else item.item)
    if phantoms:
        ends["phantom"].append(f"{phantoms} seen by mistake")
    return dict(ends)
