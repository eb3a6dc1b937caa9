"""Findings: errors and warnings about positions in files, and the exception that lists them."""

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
"""Maximum number of characters of a source line in the text of a finding."""
_MAX_ALTERNATIVES = 24
"""Maximum number of allowed words that a hint lists."""
MAX_PRINTED_FINDINGS = 50
"""Maximum number of findings in a message; the message states the number of the others."""
MAX_LISTED_FINDINGS = 1000
"""Maximum number of findings in the output of `--json`."""
_SECRET_PATTERN = re.compile(
    r"(?i)(\b\w*(?:api_?key|token|secret|password|authorization)\w*[\"']?\s*[:=]\s*|://(?=\S+@)).*"
)
"""Name of a secret, such as `api_key:`, or `://` before a user name and `@`; with the rest of the line."""
_CODES_FILE = Path(__file__).parent / "finding_codes.txt"
MEANING_BY_CODE: Mapping[str, str] = dict(
    line.split(": ", 1) for line in _CODES_FILE.read_text(encoding="utf-8").splitlines()
)
"""Meaning of each code of a finding, and the action to take."""
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
_VALUE_CODES = frozenset({
    "wrong-type", "wrong-value", "out-of-range", "port-type", "unwritten",
    "unknown-bin", "unknown-class", "unknown-detector", "unknown-pose", "unseen-class",
})  # fmt: skip
"""Codes of findings about a value: only the first finding of such a code is kept at each position."""


@dataclass(frozen=True)
class Finding:
    """An error or warning about a position in a file.

    Attributes:
        path: Path of the file in messages.
        line: Line, counted from 1; 0 denotes the whole file.
        col: Column, counted from 1.
        severity: `error` or `warning`.
        code: Code of the finding, a key of `MEANING_BY_CODE`.
        message: The problem, one sentence.
        length: Number of characters that carets underline.
        hint: Allowed values and remedy, or "".
        excerpt: The whole source line, with secrets replaced by `***`.
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
        """The part of the source line around the position, at most `_MAX_EXCERPT_LENGTH` characters."""
        return self.excerpt[self._excerpt_start : self._excerpt_start + _MAX_EXCERPT_LENGTH]

    @property
    def _excerpt_start(self) -> int:
        return max(0, self.col - _MAX_EXCERPT_LENGTH // 2) if len(self.excerpt) > _MAX_EXCERPT_LENGTH else 0

    def __str__(self) -> str:
        position = f"{self.path}:{self.line}:{self.col}" if self.line else self.path
        lines = [f"{position}: {self.severity}[{self.code}]: {self.message}"]
        if self.line and self.excerpt:
            number = f"{self.line:4d}"
            excerpt, caret_start = self.shown_excerpt, self.col - 1 - self._excerpt_start
            # Tabs are kept, so that the carets are aligned at any tab width.
            indentation = "".join(c if c == "\t" else " " for c in excerpt[:caret_start])
            caret_count = max(1, min(self.length, len(excerpt) - caret_start))
            lines.append(f"{number} | {excerpt}")
            lines.append(f"{' ' * len(number)} | {indentation}{'^' * caret_count}")
        if self.hint:
            lines.append(f"  {self.hint}")
        return "\n".join(lines)


class MissionError(InputError):
    """A mission or cell cannot be run; the message lists the findings.

    Attributes:
        findings: All findings, also those that the message omits.
    """

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        # The constructor of InputError would shorten the quotations in the findings a second time.
        Exception.__init__(self, "\n".join(describe_findings(self.findings)))


def describe_findings(findings: Sequence[Finding]) -> list[str]:
    """Return the texts of the first `MAX_PRINTED_FINDINGS` findings, and a line that counts the others."""
    texts = [str(finding) for finding in findings[:MAX_PRINTED_FINDINGS]]
    others = len(findings) - len(texts)
    return (
        [*texts, f"and {others} more findings; `executive check --json` lists up to {MAX_LISTED_FINDINGS}"]
        if others
        else texts
    )


def make_error(mark: Mark, code: str, message: str, hint: str = "") -> Finding:
    """Return an error at `mark`."""
    return _make_finding("error", mark, code, message, hint)


def make_warning(mark: Mark, code: str, message: str, hint: str = "") -> Finding:
    """Return a warning at `mark`; a mission with warnings can run."""
    return _make_finding("warning", mark, code, message, hint)


def _make_finding(severity: str, mark: Mark, code: str, message: str, hint: str) -> Finding:
    assert code in MEANING_BY_CODE, code
    source = mark.source
    excerpt = _mask_secrets(source.get_line(mark.line))
    message, hint = shorten_quotations(message), shorten_quotations(hint)
    return Finding(source.path, mark.line, mark.col, severity, code, message, mark.length, hint, excerpt)


@lru_cache(maxsize=64)
def _mask_secrets(line: str) -> str:
    """Return a line of a file in which `***` replaces secrets."""
    return _SECRET_PATTERN.sub(r"\1***", line)


def sort_findings(findings: Iterable[Finding], first_path: str) -> tuple[Finding, ...]:
    """Return the findings sorted by file, line and column, without duplicates.

    The findings of the file `first_path` come first. Two findings with the same position are duplicates if
    their texts are equal, or if both have the same code of `_VALUE_CODES`.
    """
    unique: dict[tuple[str, int, int, str], Finding] = {}
    for finding in findings:
        identity = finding.code if finding.code in _VALUE_CODES else str(finding)
        unique.setdefault((finding.path, finding.line, finding.col, identity), finding)
    return tuple(sorted(unique.values(), key=lambda f: (f.path != first_path, f.path, f.line, f.col)))


def find_similar_word(word: str, known_words: Iterable[str]) -> str | None:
    """Return the known word that is most similar to `word`, or None if none is similar."""
    words_by_lower_case = {known.lower(): known for known in known_words}
    matches = difflib.get_close_matches(word.lower(), words_by_lower_case, n=1, cutoff=0.6)
    return words_by_lower_case[matches[0]] if matches else None


def list_choices(word: str, known_words: Iterable[str], heading: str) -> str:
    """Return a hint for a wrong `word`: its new name, or the most similar known word and the known words."""
    known_words = list(known_words)
    if (renamed := RENAMED_KEYS.get(word)) in known_words:
        return f'The key is now called "{renamed}".'
    similar = find_similar_word(word, known_words)
    omitted_count = len(known_words) - _MAX_ALTERNATIVES
    more = f" and {omitted_count} more" if omitted_count > 0 else ""
    listed = f"{heading}: {', '.join(known_words[:_MAX_ALTERNATIVES]) or 'none'}{more}."
    return f'Did you mean "{similar}"? {listed}' if similar else listed
