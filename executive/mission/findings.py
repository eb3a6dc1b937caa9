"""Findings in a mission with their places, and the error that contains them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from executive.errors import InputError, shorten_quotations
from executive.mission.source import Mark

_MAX_EXCERPT_LENGTH = 140
"""Largest number of characters of a source line that a finding shows."""
_MAX_ALTERNATIVES = 24
MAX_PRINTED_FINDINGS, MAX_LISTED_FINDINGS = 50, 1000
"""Largest numbers of findings that a message and `--json` list; a message counts the others."""
_SECRET = re.compile(
    r"(?i)(\b\w*(?:api_?key|token|secret|password|authorization)\w*[\"']?\s*[:=]\s*|://(?=\S+@)).*"
)
"""A key, or a user's name, and the rest of its line."""
_CODES_FILE = Path(__file__).parent / "finding_codes.txt"
CODES: Mapping[str, str] = dict(
    line.split(": ", 1) for line in _CODES_FILE.read_text(encoding="utf-8").splitlines()
)
"""Meaning of every code of a finding, and the action to take."""
_VALUE_CODES = frozenset({
    "wrong-type", "wrong-value", "out-of-range", "port-type", "unwritten",
    "unknown-bin", "unknown-class", "unknown-detector", "unknown-pose", "unseen-class",
})  # fmt: skip
"""Codes of findings about a value; only the first finding of a code is kept at each place."""


@dataclass(frozen=True)
class Finding:
    """An error or warning about a place in a file.

    Attributes:
        path: Path of the file for the user.
        line: Counted from 1; 0 for the file as a whole.
        col: Counted from 1.
        severity: `error` or `warning`.
        code: Short stable name of the kind of finding.
        message: The problem, one sentence.
        length: Number of characters that the caret line underlines.
        hint: Allowed values and remedy, or "".
        excerpt: The whole source line, without keys and passwords.
    """

    path: str
    line: int
    col: int
    severity: str
    code: str
    message: str
    length: int = 1
    hint: str = ""
    excerpt: str = ""

    @property
    def shown_excerpt(self) -> str:
        """The part of the source line around the place, of at most `_MAX_EXCERPT_LENGTH` characters."""
        return self.excerpt[self._excerpt_start : self._excerpt_start + _MAX_EXCERPT_LENGTH]

    @property
    def _excerpt_start(self) -> int:
        return max(0, self.col - _MAX_EXCERPT_LENGTH // 2) if len(self.excerpt) > _MAX_EXCERPT_LENGTH else 0

    def __str__(self) -> str:
        place = f"{self.path}:{self.line}:{self.col}" if self.line else self.path
        lines = [f"{place}: {self.severity}[{self.code}]: {self.message}"]
        if self.line and self.excerpt:
            number = f"{self.line:4d}"
            excerpt, before = self.shown_excerpt, self.col - 1 - self._excerpt_start
            # Tabs are kept, so that the caret is aligned at any tab width.
            blank = "".join(c if c == "\t" else " " for c in excerpt[:before])
            room = max(1, min(self.length, len(excerpt) - before))
            lines.append(f"{number} | {excerpt}")
            lines.append(f"{' ' * len(number)} | {blank}{'^' * room}")
        if self.hint:
            lines.append(f"  {self.hint}")
        return "\n".join(lines)


class MissionError(InputError):
    """A mission cannot be run; the text lists the findings in file order.

    Attributes:
        findings: All findings.
    """

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        # The constructor of InputError would shorten the texts of the findings again.
        Exception.__init__(self, "\n".join(describe_findings(self.findings)))


def describe_findings(findings: Sequence[Finding]) -> list[str]:
    """Return the texts of the first findings, and a line with the number of the others."""
    texts = [str(finding) for finding in findings[:MAX_PRINTED_FINDINGS]]
    others = len(findings) - len(texts)
    return (
        [*texts, f"and {others} more findings; `executive check --json` lists up to {MAX_LISTED_FINDINGS}"]
        if others
        else texts
    )


def error(mark: Mark, code: str, message: str, hint: str = "") -> Finding:
    """Return an error at `mark`."""
    return _finding("error", mark, code, message, hint)


def warning(mark: Mark, code: str, message: str, hint: str = "") -> Finding:
    """Return a warning at `mark`; the mission can run nevertheless."""
    return _finding("warning", mark, code, message, hint)


def _finding(severity: str, mark: Mark, code: str, message: str, hint: str) -> Finding:
    assert code in CODES, code
    source = mark.source
    excerpt = _without_secrets(source.line(mark.line))
    message, hint = shorten_quotations(message), shorten_quotations(hint)
    return Finding(source.path, mark.line, mark.col, severity, code, message, mark.length, hint, excerpt)


@lru_cache(maxsize=64)
def _without_secrets(line: str) -> str:
    """Return a line of a file in which `***` replaces keys and passwords."""
    return _SECRET.sub(r"\1***", line)


def in_file_order(findings: Iterable[Finding], first: str) -> tuple[Finding, ...]:
    """Return the findings in the order of the text, and the findings of the file `first` first.

    Of several findings about a value with the same code, only the first is kept.
    """
    unique: dict[tuple[str, int, int, str], Finding] = {}
    for finding in findings:
        kind = finding.code if finding.code in _VALUE_CODES else str(finding)
        unique.setdefault((finding.path, finding.line, finding.col, kind), finding)
    return tuple(sorted(unique.values(), key=lambda f: (f.path != first, f.path, f.line, f.col)))


def suggest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that is most similar to `word`, or None."""
    by_lower = {name.lower(): name for name in known}
    close = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[close[0]] if close else None


RENAMED_KEYS = {
    "aim": "max_position_std",
    "confused": "confusion_rate",
    "invented": "false_detections",
    "least_force": "min_force",
    "misjudged": "max_class_error",
    "misses": "miss_rate",
    "most": "max",
    "overlooked": "max_miss_probability",
    "planning": "planning_time",
}
"""New names by the former names of keys in mission and cell files."""


def alternatives(word: str, known: Iterable[str], lead: str) -> str:
    """Return a hint with the new name or the most similar known word, `lead` and the known words."""
    known = list(known)
    if (renamed := RENAMED_KEYS.get(word)) in known:
        return f'The key is now called "{renamed}".'
    meant = suggest(word, known)
    more = f" and {len(known) - _MAX_ALTERNATIVES} more" if len(known) > _MAX_ALTERNATIVES else ""
    listed = f"{lead}: {', '.join(known[:_MAX_ALTERNATIVES]) or 'none'}{more}."
    return f'Did you mean "{meant}"? {listed}' if meant else listed
