"""Which run directory a name means."""

from __future__ import annotations

import os
from pathlib import Path

from executive.errors import InputError

LATEST = "latest"


def find_run(name: str, runs: Path) -> Path:
    """Return the run directory that `name` means: a path, or one below `runs`; `latest` is the last one.

    Raises:
        InputError: There is no such directory, or no run in it.
    """
    for path in (Path(name), runs / name):
        # Unlike Path's method this one says no to a name that no file can have.
        if os.path.isfile(path / "journal.jsonl"):
            return path.resolve()
    known = sorted((path.parent for path in runs.glob("*/*/journal.jsonl")), reverse=True)
    hint = f"the last ones there: {', '.join(str(path.relative_to(runs)) for path in known[:3])}"
    raise InputError(
        f'"{name}" is no run directory, nor is there one of that name below "{runs}"; '
        f"{hint if known else 'there is none at all; say where they are with --runs DIR'}"
    )
