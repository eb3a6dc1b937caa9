"""The last words of a run: how it ended, how long it took, where the record is and how to repeat it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.view.items import ItemTable
from executive.view.story import story_lines


def verdict(result: Mapping[str, Any]) -> str:
    """Return how a run ended in one line: status, reason, node and sentence."""
    # The reason of a fault or a halt is the status once more.
    told = result["reason"] and result["reason"].upper() != result["status"]
    reason = f" {result['reason']}" if told else ""
    where = f" at {result['node']}" if result["node"] else ""
    why = f": {result['message']}" if result["message"] else ""
    return f"{result['status']}{reason}{where}{why}"


def summary(result: Mapping[str, Any], items: ItemTable, repeat: str, report: str = "") -> str:
    """Return how it ended, how long it took, and a line for each bin and each other fate of an item.

    `report` is the file of its report, or "".

    What did not succeed ends with its story instead: what is read first stands last on a terminal.
    """
    robot, wall = result["robot_time_s"], result["wall_time_s"]
    times = f"{robot:.1f} s on the robot's clock, {wall:.1f} s by the wall clock"
    fates = [f"  {fate}: {', '.join(names)}" for fate, names in sorted(items.by_fate().items())]
    story = result.get("story")
    if story is None:
        lines = [verdict(result), times, f"{result['run']}  (repeat: {repeat})", *fates]
        lines += [f"report: {report}"] if report else []
    else:
        lines = [times, *fates, "", *story_lines(story, result["run"], repeat, report)]
    return "\n".join(lines) + "\n"
