# ruff: noqa: E501 - findings are quoted as they are printed
"""YAML 1.2 text with positions."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from executive.text.findings import Source
from executive.text.yaml_files import convert_scalar, parse_yaml


def read(text: str) -> tuple[Any, list[str]]:
    root, findings = parse_yaml(Source("a.yaml", text))
    return (None if root is None else root.python_value), [str(finding) for finding in findings]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001), ("no", "no"), ("yes", "yes"), ("on", "on"), ("12:30", "12:30"), ("010", 10),
        ("0o17", 15), ("0x1F", 31), (".5", 0.5), ("-3", -3), ("true", True), ("~", None), ("1_000", "1_000"),
        ("2026-11-21", "2026-11-21"), ("-", "-"), ("+.inf", float("inf")), ("1.", 1.0), ("9" * 400, "9" * 400),
    ],
)  # fmt: skip
def test_plain_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    read_value = convert_scalar(text)
    assert read_value == value and type(read_value) is type(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: '1'\nb: \"no\"\n", {"a": "1", "b": "no"}),
        ("on: [a]\nyes: 1\n", {"on": ["a"], "yes": 1}),
        ("a: &x [1]\nb: *x\n", {"a": [1], "b": [1]}),
    ],
)
def test_quoted_scalars_and_keys_are_text_and_aliases_what_is_marked(text: str, value: object) -> None:
    assert read(text) == (value, [])


def test_a_billion_laughs_are_refused() -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i + 1}: &a{i + 1} [{', '.join([f'*a{i}'] * 10)}]" for i in range(9)]
    root, (finding,) = read("\n".join(lines))
    assert root is None
    assert (
        "error[too-large]: the file has more than 20000 keys and values, including those of aliases"
        in finding
    )


def test_aliases_cannot_nest_deeper_than_text() -> None:
    lines = ["a0: &a0 [1]"] + [f"a{i + 1}: &a{i + 1} [*a{i}]" for i in range(2000)]
    assert "nested more than 50 levels deep" in read("\n".join(lines))[1][0]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "the file is empty"),
        ("a: !!python/object:os.system x\n", "is not allowed"),
        ("a: !x 1\n", 'the tag "!x" is not allowed'),
        ("? [a]\n: b\n", "a key must be a single word"),
        ("a:\n\t- b\n", "found character '\\t' that cannot start any token"),
        ("a: \x07\n", "the character '\\x07' is not allowed in YAML"),
        ("a: b: c\n", "mapping values are not allowed here"),
    ],
)
def test_what_a_mission_cannot_use_is_refused(text: str, sentence: str) -> None:
    assert sentence in read(text)[1][0]


def test_half_a_surrogate_pair_is_refused() -> None:
    # Only an escape can name one; printed, it would end in a traceback.
    root, findings = parse_yaml(Source("m.yaml", 'a: "x\\ud800"\n'))
    assert root is not None
    assert [(f.line, f.col, f.message) for f in findings] == [
        (1, 4, "a surrogate (U+D800 to U+DFFF) is no character")
    ]
    assert root.python_value == {"a": "x?"}


FRAGMENTS = [
    "a", "b1", "0.5", "~", "'c d'", '"e"', ": ", ":", "- ", "-", "{", "}", "[", "]", ", ", "\n", "\n  ", "\n    ",
    "&x ", "*x", "!t ", "|\n", ">-\n", "# f", "<<: ", "? ", "\t", "\r", "\ufeff", "\x85", "²", "\U0001f600", "%", "@",
    "---\n", "...\n", "\x00", '"\\ud800"',
]  # fmt: skip


@given(st.lists(st.sampled_from(FRAGMENTS), max_size=20).map("".join))
def test_the_parser_of_libyaml_changes_no_node_and_no_finding(text: str) -> None:
    source = Source("a.yaml", text)
    with patch("executive.text.yaml_files._FAST_LOADER", yaml.SafeLoader):
        expected = parse_yaml(source)
    assert parse_yaml(source) == expected
