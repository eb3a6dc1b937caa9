"""Every shipped loop ends, and gives each object a limited number of picks, whatever fails."""

from __future__ import annotations

import pytest

from tests.benchmarks.library_loops import explain_problem


@pytest.mark.parametrize("seed", [pytest.param(12, marks=pytest.mark.slow), 15])
def test_each_loop_ends_after_a_limited_number_of_picks_of_each_object(seed: int) -> None:
    assert explain_problem(seed, "fake") == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(40, 49), 5290, 5422])
def test_each_shipped_loop_ends_with_books_that_agree_or_name_the_items(seed: int) -> None:
    assert explain_problem(seed, "fake") == ""
