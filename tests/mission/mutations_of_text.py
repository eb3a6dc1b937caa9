"""Mutations of a mission's text, which know nothing of YAML: characters, words and lines."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

_ODD_TEXTS = (
    "&a ", "*a", "!!int ", "!!python/object:os.system ", "<<: ", "\t", "\r", "\0", "\ufeff", "\u2028",
    "---\n", "...\n", "%YAML 1.1\n", "{", "}", "[", "]", '"', "'", "|", ">", "- ", "? ", ": ", ", ", "# ",
    "@", "`", "\\", "\n", "\n\n  ", "0x" + "f" * 290, "1e999", "-.inf", ".nan", "0o17", "1_000", "~", "yes",
    "\U0001f980", "\x85", '"\\ud800"', '"\\0"', "x" * 300,
)  # fmt: skip


def _place(rng: random.Random, text: str) -> int:
    return rng.randrange(len(text) + 1)


def delete_character(rng: random.Random, text: str) -> str:
    at = _place(rng, text)
    return text[:at] + text[at + 1 :]


def double_character(rng: random.Random, text: str) -> str:
    at = _place(rng, text)
    return text[:at] + text[at : at + 1] + text[at:]


def swap_characters(rng: random.Random, text: str) -> str:
    at = _place(rng, text)
    return text[:at] + text[at : at + 2][::-1] + text[at + 2 :]


def insert_oddity(rng: random.Random, text: str) -> str:
    at = _place(rng, text)
    return text[:at] + rng.choice(_ODD_TEXTS) + text[at:]


def replace_word(rng: random.Random, text: str) -> str:
    words = list(re.finditer(r"[\w.$]+", text))
    if not words:
        return text
    word = rng.choice(words)
    return text[: word.start()] + rng.choice(_ODD_TEXTS) + text[word.end() :]


def delete_line(rng: random.Random, text: str) -> str:
    return _changed_lines(rng, text, lambda line, other: [])


def double_line(rng: random.Random, text: str) -> str:
    return _changed_lines(rng, text, lambda line, other: [line, line])


def replace_line(rng: random.Random, text: str) -> str:
    return _changed_lines(rng, text, lambda line, other: [other])


def indent_line(rng: random.Random, text: str) -> str:
    blanks = rng.choice(("  ", " ", "\t"))
    return _changed_lines(rng, text, lambda line, other: [blanks + line])


def dedent_line(rng: random.Random, text: str) -> str:
    return _changed_lines(rng, text, lambda line, other: [line.removeprefix("  ")])


def swap_lines(rng: random.Random, text: str) -> str:
    lines = text.splitlines(keepends=True)
    if len(lines) > 1:
        at = rng.randrange(len(lines) - 1)
        lines[at : at + 2] = lines[at + 1], lines[at]
    return "".join(lines)


def cut_off(rng: random.Random, text: str) -> str:
    return text[: _place(rng, text)]


def _changed_lines(rng: random.Random, text: str, change: Callable[[str, str], list[str]]) -> str:
    lines = text.splitlines(keepends=True)
    if lines:
        at = rng.randrange(len(lines))
        lines[at : at + 1] = change(lines[at], rng.choice(lines))
    return "".join(lines)


OF_TEXT = (
    delete_character, double_character, swap_characters, insert_oddity, replace_word, delete_line,
    double_line, replace_line, indent_line, dedent_line, swap_lines, cut_off,
)  # fmt: skip
"""Every mutation."""
