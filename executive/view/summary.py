"""The last words of a run: how it ended, how long it took, where the record is and how to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from typing import Any

from executive.view.items import ItemTable


def repeat_command(
    mission: str, *, seed: int, overrides: Mapping[str, str], requests: Iterable[str] = ()
) -> str:
    """Return the command line that repeats a run exactly."""
    words = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        words += ["--set", f"{key}={value}"]
    for request in requests:
        words += ["--request", request]
    return shlex.join(words)


def verdict(result: Mapping[str, Any]) -> str:
    """Return how a run ended in one line: status, reason, node and sentence."""
    # The reason of a fault or a halt is the status once more.
    told = result["reason"] and result["reason"].upper() != result["status"]
    reason = f" {result['reason']}" if told else ""
    where = f" at {result['node']}" if result["node"] else ""
    why = f": {result['message']}" if result["message"] else ""
    return f"{result['status']}{reason}{where}{why}"


def summary(result: Mapping[str, Any], items: ItemTable, repeat: str) -> str:
    """Return three lines, then one for each bin and for each other fate of an item."""
    lines = [
        verdict(result),
        f"{result['robot_time_s']:.1f} s on the robot's clock, "
        f"{result['wall_time_s']:.1f} s by the wall clock",
        f"{result['run']}  (repeat: {repeat})",
    ]
    lines += [f"  {fate}: {', '.join(names)}" for fate, names in sorted(items.by_fate().items())]
    return "\n".join(lines) + "\n"
