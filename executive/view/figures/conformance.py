"""Results of the conformance checks of skills, as one line per check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from executive.testing.conformance.check import Verdict


def conformance_lines(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield a line per check: its status, its skill, and the first problem."""
    for verdict in verdicts:
        line = f"{verdict.status:7}  {verdict.skill}.{verdict.check}"
        # The reason why the skill could not be run is stated once.
        if verdict.status == "failed":
            more = len(verdict.problems) - 1
            line += f": {verdict.problems[0]}" + (f" (and {more} more)" if more else "")
        yield line


def conformance_total(verdicts: Sequence[Verdict]) -> str:
    """Return the number of checks by status as text."""
    counts = Counter(verdict.status for verdict in verdicts)
    skills = len({verdict.skill for verdict in verdicts})
    counted = ", ".join(
        f"{counts[status]} {status}" for status in ("ok", "failed", "not run") if counts[status]
    )
    return f"{len(verdicts)} checks of {skills} skill{'s' if skills != 1 else ''}: {counted}"
