"""Text in a picture: its length, what is left of it where room is short, and what XML can hold."""

from __future__ import annotations

import pytest

from executive.view.drawing import replace_invalid_xml_characters, wrap_and_truncate


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("", ()),
        ("one two three", ("one two", "three")),
        ("a: 1, b: 2", ("a: 1, b: 2",)),
        ("alpha: 1, beta: 2", ("alpha: 1,", "beta: 2")),
        ("a\n  b\tc", ("a b c",)),
        ("alpha: 1, beta: 2, gamma: 3", ("alpha: 1,", "beta: 2, …")),
    ],
)
def test_text_is_cut_behind_a_comma_where_it_can_be(text, rows):
    assert wrap_and_truncate(text, 11, 2) == rows


def test_what_xml_cannot_hold_is_replaced():
    assert replace_invalid_xml_characters("a\x00\x1b\ud800\ufffeb\tc\n€𝄞") == "a����b\tc\n€𝄞"
