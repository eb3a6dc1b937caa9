"""Whether there is a screen for the simulator's window."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping

from executive.cli.doctor.finding import Finding


def display(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Yield what DISPLAY says, and what follows for --gui."""
    if name := environment.get("DISPLAY"):
        yield Finding("ok", "display", f"DISPLAY is {name}, where --gui opens the simulator's window")
    else:
        yield Finding(
            "note", "display", "DISPLAY is not set",
            "run without --gui, which needs it: terminal, `--view` and report show a run, too",
        )  # fmt: skip
