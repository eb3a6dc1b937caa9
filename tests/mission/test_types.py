"""Which types of ports fit each other, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Optional

import pytest

from executive.cell.frame import Detection
from executive.cell.objects import Target
from executive.mission.ports import find_element_type, is_assignable


class Special(Target):
    """A kind of target."""


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (int, int), (int, float), (Special, Target), (str, str | None), (list[int], list), (Any, Target),
        (None | str, Optional[str]),  # noqa: UP045 - both ways of writing it
        (list[int], list[float]), (list[Special], Sequence[Target]), (tuple[int, ...], Sequence[float]),
        (Target, Any), (int, float | str),
    ],
)  # fmt: skip
def test_these_fit(given: Any, wanted: Any) -> None:
    assert is_assignable(given, wanted)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (float, int), (Target, Special), (str | None, str), (list[Target], Target), (Target, list[Target]),
        (list[Target], list[Detection]), (str, list[str]), (Target, str), (float, int | str),
    ],
)  # fmt: skip
def test_these_do_not_fit(given: Any, wanted: Any) -> None:
    assert not is_assignable(given, wanted)


def test_a_list_has_elements_and_a_text_has_none() -> None:
    types = (list[Target], Sequence[int], tuple[int, ...], list, str, Target)
    assert [find_element_type(one) for one in types] == [Target, int, int, Any, None, None]
