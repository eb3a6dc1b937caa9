"""Escaped control characters and shortened quotations."""

from __future__ import annotations

import json

import pytest

from executive.errors import MAX_QUOTATION_LENGTH, escape_control_characters, shorten_quotations


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("red\x1b[31m", "red\\u001b[31m"),
        ("bell\x07 and \x9b", "bell\\u0007 and \\u009b"),
        ("a\rb", "a\\u000db"),
        ("right to left \u202e", "right to left \\u202e"),
        ("half \ud800", "half \\ud800"),
        ("tab\tand\nline feed, Würfel, 立方体", "tab\tand\nline feed, Würfel, 立方体"),
    ],
)
def test_characters_that_control_a_terminal_are_escaped(text: str, shown: str) -> None:
    assert escape_control_characters(text) == shown


def test_escaped_json_has_the_same_value() -> None:
    value = {"label": "\x9b\u202e\x7f"}
    assert json.loads(escape_control_characters(json.dumps(value, ensure_ascii=False))) == value


def test_quotations_and_words_are_cut() -> None:
    quoted, word = '"' + "a b " * 100 + '"', "c" * 300
    short = shorten_quotations(f"unknown {quoted} in {word}; there are: d")
    first, second = short.removeprefix("unknown ").split(" in ")
    assert (len(first), first[-2:]) == (MAX_QUOTATION_LENGTH, '…"')
    assert second == "c" * (MAX_QUOTATION_LENGTH - 1) + "…; there are: d".replace(
        "; there are: d", " there are: d"
    )
