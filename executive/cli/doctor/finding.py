"""What the doctor says of one thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Mark = Literal["ok", "note", "problem"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        mark: `ok`; `note`: something cannot be used, and nothing that comes with the project needs it;
            `problem`: the project cannot work so.
        subject: What was looked at, in a word.
        told: What is so.
        cure: What to do where that is not as wished, or "".
    """

    mark: Mark
    subject: str
    told: str
    cure: str = ""

    def __str__(self) -> str:
        return f"{self.told}; {self.cure}" if self.cure else self.told


def lines(findings: Sequence[Finding]) -> list[str]:
    """Return a line per finding, marks and subjects aligned, and one that sums up."""
    width = max((len(finding.subject) for finding in findings), default=0)
    told = [f"{finding.mark:7}  {finding.subject:{width}}  {finding}" for finding in findings]
    problems = sum(finding.mark == "problem" for finding in findings)
    return [*told, f"{problems} problem{'s' if problems > 1 else ''}" if problems else "all is well"]
