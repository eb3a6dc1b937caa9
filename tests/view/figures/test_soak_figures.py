"""What is told of many runs in one process, and what counts as growing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.view.figures.soak import MOST_GROWTH, Sample, SoakFigures, as_plain, soak_text


def figures(*memory: float, threads: int = 4, failed: tuple[tuple[int, str], ...] = ()) -> SoakFigures:
    samples = [Sample(one, threads, 6, 1000 + number) for number, one in enumerate(memory)]
    return SoakFigures("sort", "fake", 3, tuple(samples), failed, len(memory))


FLAT = figures(*[100.0, 180.0], *[200.0] * 38)


def test_memory_that_is_taken_at_the_beginning_and_kept_is_flat() -> None:
    assert FLAT.slope == pytest.approx(0.0, abs=1e-9)
    assert FLAT.growth == 0.0
    assert FLAT.left_behind == pytest.approx(1.0)
    assert FLAT.problems == ()


@given(st.floats(50, 500), st.floats(1.1 * MOST_GROWTH, 1000), st.integers(30, 200))
def test_memory_that_grows_with_every_run_is_found(begin: float, growth: float, runs: int) -> None:
    growing = figures(*[begin + growth / runs * number for number in range(runs)])
    assert growing.slope == pytest.approx(growth / runs)
    assert any(problem.startswith("a run adds ") for problem in growing.problems)


def test_what_the_first_runs_load_is_no_growth() -> None:
    assert figures(100.0, 160.0, *[190.0] * 6).problems == ()


def test_memory_that_grows_in_jumps_is_found() -> None:
    jumped = figures(*[100.0] * 20, *[130.0] * 20)
    assert "the last quarter of the runs needs 30.0 MB more than the first; 20 is allowed" in jumped.problems


def test_threads_that_stay_are_found() -> None:
    samples = tuple(Sample(100.0, 4 + (number == 11), 6, 1000) for number in range(12))
    grown = SoakFigures("sort", "fake", 3, samples, (), 12)
    assert grown.problems == ("5 threads after the last run, 4 after run 5",)


def test_fewer_threads_than_before_are_no_problem() -> None:
    samples = tuple(Sample(100.0, 4 - (number == 11), 6, 1000) for number in range(12))
    assert SoakFigures("sort", "fake", 3, samples, (), 12).problems == ()


def test_objects_that_stay_are_found() -> None:
    samples = tuple(Sample(100.0, 4, 6, 1000 + 3 * number) for number in range(12))
    grown = SoakFigures("sort", "fake", 3, samples, (), 12)
    assert grown.problems == ("a run leaves 3.0 objects behind; 2 is allowed",)


def test_a_single_run_has_no_slope() -> None:
    assert (figures(100.0).slope, figures(100.0).problems) == (0.0, ())


def test_all_of_it_is_told() -> None:
    assert soak_text(FLAT).splitlines() == [
        "sort (fake): 40 runs in one process, seeds from 3",
        "  memory 200.0 MB after 200.0 MB when warm; +0.0000 MB a run (0.5 allowed), "
        "last quarter over first +0.0 MB (20 allowed)",
        "  threads 4 after 4, handles 6 after 6, objects 1039 after 1004: +1.00 a run (2 allowed)",
        "  runs that did not succeed: none",
    ]


def test_a_run_that_failed_and_a_campaign_cut_short_are_told() -> None:
    one = SoakFigures("sort", "fake", 3, (Sample(100.0, 4, 6, 1000),), ((3, "FAILURE lost"),), 9)
    text = soak_text(one)
    assert "ended by the user; 9 runs were wanted" in text
    assert text.endswith("runs that did not succeed: 1\n    seed 3: FAILURE lost")


def test_a_campaign_ended_before_its_first_run_has_nothing_to_tell() -> None:
    none = SoakFigures("sort", "fake", 3, (), (), 9)
    assert none.problems == ()
    assert soak_text(none).splitlines()[1:] == ["  ended by the user; 9 runs were wanted"]
    assert as_plain(none)["runs"] == 0


def test_as_plain_values() -> None:
    plain = as_plain(figures(100.0, 110.0, failed=((4, "FAULT"),)))
    assert plain["memory_mb"] == [100.0, 110.0]
    assert plain["last"] == {"memory_mb": 110.0, "threads": 4, "handles": 6, "objects": 1001}
    assert plain["failed"] == [{"seed": 4, "verdict": "FAULT"}]
