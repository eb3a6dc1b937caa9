"""Findings: errors and warnings about positions in files, and their wording."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from pydantic_core import ErrorDetails

from executive.errors import InputError, shorten_quotations


@dataclass(frozen=True, eq=False)
class Source:
    """A text and its name in messages.

    Attributes:
        path: Name that precedes each position in messages: path of a file, or `--set`.
        text: The whole text.
    """

    path: str
    text: str

    def get_line(self, number: int) -> str:
        """Return line `number`, counted from 1, or "" beyond the end."""
        return self._lines[number - 1] if 1 <= number <= len(self._lines) else ""

    @cached_property
    def _lines(self) -> list[str]:
        return self.text.splitlines()

    def make_span(self, line: int = 0, col: int = 0, length: int = 0) -> Span:
        """Return a span in this text; line 0 denotes the whole text."""
        return Span(self, line, col, length)


@dataclass(frozen=True)
class Span:
    """Position of a part of a source text.

    Attributes:
        source: The text.
        line: First line, counted from 1; 0 denotes the whole text.
        col: Column of the first character, counted from 1.
        length: Number of characters; at most the first line is underlined.
    """

    source: Source
    line: int
    col: int
    length: int

    def describe_place(self, source: Source) -> str:
        """Return `line 12` if the position is in `source`, otherwise `path:12`."""
        return f"line {self.line}" if self.source is source else f"{self.source.path}:{self.line}"


NOWHERE = Source("", "").make_span()
"""Position of a value that no text contains."""


_MAX_EXCERPT_LENGTH = 140
"""Maximum number of characters of a source line in the text of a finding."""
_MAX_ALTERNATIVES = 30
"""Maximum number of allowed words in a hint."""
MAX_PRINTED_FINDINGS = 50
"""Maximum number of findings in a message; the message also states the number of omitted findings."""
MAX_LISTED_FINDINGS = 1000
"""Maximum number of findings in the output of `--json`."""
_SECRET_PATTERN = re.compile(
    r"(?i)(\b\w*(?:api_?key|token|secret|password|authorization)\w*[\"']?\s*[:=]\s*|://(?=\S+@)).*"
)
"""Matches `api_key:` and similar names, or `://` before a user name and `@`, up to the end of the line."""
_CODES = (Path(__file__).parent / "finding_codes.txt").read_text(encoding="utf-8")
MEANING_BY_CODE: Mapping[str, str] = dict(line.split(": ", 1) for line in _CODES.splitlines())
"""Meaning of each code of a finding, and the action to take."""
_VALUE_CODES = frozenset({
    "wrong-type", "wrong-value", "out-of-range", "port-type", "unwritten",
    "unknown-bin", "unknown-class", "unknown-detector", "unknown-pose", "unseen-class",
})  # fmt: skip
"""Codes of findings about a value; `sort_findings` keeps one finding per position and code."""
WORD_BY_OTHER_WORD = {
    "aim": "max_position_std",
    "and": "all",
    "confused": "confusion_rate",
    "else": "try",
    "for": "for_each",
    "if": "try",
    "invented": "false_detections",
    "least_force": "min_force",
    "loop": "repeat",
    "misjudged": "max_class_error",
    "misses": "miss_rate",
    "most": "max",
    "or": "any",
    "overlooked": "max_miss_probability",
    "planning": "planning_time",
    "selector": "fallback",
}
"""Word of the current language by a word that was renamed, or that other languages use."""


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
        length: Number of characters that are underlined with carets (`^`).
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
        """Index of the first character of `excerpt` in `shown_excerpt`."""
        return max(0, self.col - _MAX_EXCERPT_LENGTH // 2) if len(self.excerpt) > _MAX_EXCERPT_LENGTH else 0

    def __str__(self) -> str:
        position = f"{self.path}:{self.line}:{self.col}" if self.line else self.path
        lines = [f"{position}: {self.severity}[{self.code}]: {self.message}"]
        if self.line and self.excerpt:
            number = f"{self.line:4d}"
            excerpt = self.shown_excerpt
            caret_start = self.col - 1 - self._excerpt_start
            # Tabs are kept, so that the carets are aligned at any tab width.
            indentation = re.sub(r"[^\t]", " ", excerpt[:caret_start])
            caret_count = max(1, min(self.length, len(excerpt) - caret_start))
            lines.append(f"{number} | {excerpt}")
            lines.append(f"{' ' * len(number)} | {indentation}{'^' * caret_count}")
        if self.hint:
            lines.append(f"  {self.hint}")
        return "\n".join(lines)


class MissionError(InputError):
    """A mission or cell has errors; the message lists the findings.

    Attributes:
        findings: All findings, also those that the message omits.
    """

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        # The constructor of InputError would shorten the quotations in the findings a second time.
        Exception.__init__(self, "\n".join(describe_findings(self.findings)))


def describe_findings(findings: Sequence[Finding]) -> list[str]:
    """Return the texts of the first `MAX_PRINTED_FINDINGS` findings, and the number of omitted findings."""
    texts = [str(finding) for finding in findings[:MAX_PRINTED_FINDINGS]]
    if omitted_count := len(findings) - len(texts):
        advice = f"`executive check --json` lists up to {MAX_LISTED_FINDINGS}"
        texts.append(f"and {omitted_count} more findings; {advice}")
    return texts


def make_error(span: Span, code: str, message: str, hint: str = "", severity: str = "error") -> Finding:
    """Return an error at `span`, or a finding of another severity."""
    assert code in MEANING_BY_CODE, code
    source = span.source
    excerpt = _mask_secrets(source.get_line(span.line))
    message = shorten_quotations(message)
    hint = shorten_quotations(hint)
    return Finding(source.path, span.line, span.col, severity, code, message, span.length, hint, excerpt)


def make_warning(span: Span, code: str, message: str, hint: str = "") -> Finding:
    """Return a warning at `span`; a mission with warnings can run."""
    return make_error(span, code, message, hint, "warning")


@lru_cache(maxsize=64)
def _mask_secrets(line: str) -> str:
    """Return a line with `***` in place of secrets; cached, because a long line may have many findings."""
    return _SECRET_PATTERN.sub(r"\1***", line)


def sort_findings(findings: Iterable[Finding], first_path: str) -> tuple[Finding, ...]:
    """Return the findings sorted by file (`first_path` first), line and column, without duplicates.

    Findings at one position are duplicates if they have the same text, or the same code in `_VALUE_CODES`.
    """
    unique: dict[tuple[bool, str, int, int, str], Finding] = {}
    for finding in findings:
        identity = finding.code if finding.code in _VALUE_CODES else str(finding)
        position = (finding.path != first_path, finding.path, finding.line, finding.col)
        unique.setdefault((*position, identity), finding)
    return tuple(unique[key] for key in sorted(unique, key=lambda key: key[:-1]))


def find_similar_word(word: str, known_words: Iterable[str]) -> str | None:
    """Return the known word that is most similar to `word`, or None if none is similar."""
    words_by_lower_case = {known_word.lower(): known_word for known_word in known_words}
    matches = difflib.get_close_matches(word.lower(), words_by_lower_case, n=1, cutoff=0.6)
    return words_by_lower_case[matches[0]] if matches else None


def suggest_word(value: object, allowed_words: Iterable[str]) -> str:
    """Return ` (did you mean "WORD"?)` with the allowed word most similar to `value`, or ""."""
    similar = find_similar_word(value, allowed_words) if isinstance(value, str) else None
    return f' (did you mean "{similar}"?)' if similar else ""


def suggest_choice(word: str, allowed_words: Iterable[str], heading: str) -> str:
    """Return a hint for a wrong word: the word to write instead, or the allowed words after `heading`."""
    allowed_words = list(allowed_words)
    if (replacement := WORD_BY_OTHER_WORD.get(word)) in allowed_words:
        return f'Write "{replacement}".'
    similar = find_similar_word(word, allowed_words)
    omitted_count = len(allowed_words) - _MAX_ALTERNATIVES
    ending = f" and {omitted_count} more" if omitted_count > 0 else ""
    choices = f"{heading}: {', '.join(allowed_words[:_MAX_ALTERNATIVES]) or 'none'}{ending}."
    return f'Did you mean "{similar}"? {choices}' if similar else choices


_TYPE_PHRASES = {
    "string_type": "a text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "set_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dataclass_type": "a mapping",
    "none_required": "left empty",
}
"""Description of the expected type, by the type of pydantic's error."""
_BOUND_PHRASES = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
"""Comparison in words, and key of the bound in `ErrorDetails.ctx`, by the type of pydantic's error."""


def describe_value(value: object) -> str:
    """Return a description of a plain value, for the end of a sentence: `a list of length 2`."""
    if value is None:
        return "nothing"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, int):
        return str(value).lower()  # Booleans are integers, too.
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Sequence):
        return f"a list of length {len(value)}"
    return "a mapping"


def describe_validation_error(error: ErrorDetails) -> str:
    """Return the message of a pydantic error, without the name of the value: `must be at least 1, not 0`."""
    error_type = error["type"]
    value = error["input"]
    context = error.get("ctx", {})
    if error_type in _TYPE_PHRASES:
        return f"must be {_TYPE_PHRASES[error_type]}, not {describe_value(value)}"
    if error_type in _BOUND_PHRASES:
        comparison, key = _BOUND_PHRASES[error_type]
        return f"must be {comparison} {context[key]:g}, not {describe_value(value)}"
    if error_type == "literal_error":
        expected = context["expected"]
        # Pydantic lists the allowed words in single quotes.
        suggestion = suggest_word(value, re.findall("'([^']*)'", expected))
        choices = expected.replace("'", '"')
        return f"must be {choices}, not {describe_value(value)}{suggestion}"
    if error_type == "too_short":
        return f"has {context['actual_length']} entries, but needs at least {context['min_length']}"
    if error_type == "too_long":
        return f"has {len(value)} entries, but may have at most {context['max_length']}"
    if error_type == "value_error":
        return str(context["error"])
    return f"is not allowed here: {error['msg'][:1].lower()}{error['msg'][1:]}"
