"""Results of the conformance checks of skills, as text with one line per check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from executive.testing.conformance.conformance_check import Verdict


def format_verdicts(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield a line per check: status, skill, name of the check, and the first problem of a failed check."""
    for verdict in verdicts:
        line = f"{verdict.status:7}  {verdict.skill}.{verdict.check}"
        if verdict.status == "failed":
            other_count = len(verdict.problems) - 1
            line += f": {verdict.problems[0]}" + (f" (and {other_count} more)" if other_count else "")
        yield line


def format_verdict_counts(verdicts: Sequence[Verdict]) -> str:
    """Return a text with the number of checks by status."""
    counts = Counter(verdict.status for verdict in verdicts)
    skill_count = len({verdict.skill for verdict in verdicts})
    statuses = (status for status in ("ok", "failed", "not run") if counts[status])
    counts_text = ", ".join(f"{counts[status]} {status}" for status in statuses)
    return f"{len(verdicts)} checks of {skill_count} skill{'s' if skill_count != 1 else ''}: {counts_text}"
