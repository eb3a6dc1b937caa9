"""The command that repeats a run."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping


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
