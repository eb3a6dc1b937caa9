from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.mutations import Mutation, find_mutations

SOURCE = '''
"""Text with 1 number."""

def clamp(value, low=0):
    """Return 2 things."""
    if value < low:
        raise ValueError(f"{value + 1} is too small", 3)
    print(value, low)
    return value + 1
'''


@pytest.fixture(scope="module")
def mutations() -> list[Mutation]:
    return list(find_mutations(Path("clamp.py"), SOURCE))


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("operator", {("value < low", "(value <= low)"), ("value + 1", "((value) - (1))")}),
        ("constant", {("0", "1"), ("1", "2")}),
        ("deleted line", {("print(value, low)", "pass"), ("return value + 1", "pass")}),
        ("swapped arguments", {("print(value, low)", "print(low, value)")}),
    ],
)
def test_every_kind_is_found_and_no_message_is_changed(
    mutations: list[Mutation], kind: str, expected: set[tuple[str, str]]
) -> None:
    assert {(one.old, one.new) for one in mutations if one.kind == kind} == expected


def test_the_span_of_a_mutation_is_the_text_that_it_replaces(mutations: list[Mutation]) -> None:
    data = SOURCE.encode()
    for one in mutations:
        assert data[slice(*one.span)].decode() == one.old
