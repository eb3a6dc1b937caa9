"""Many jobs in processes of their own."""

from __future__ import annotations

from executive.campaign.pool import do_all


def half(number: int) -> float:
    """Return half of an even number."""
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number / 2


def why(number: int, error: BaseException) -> str:
    return f"{number}: {error}"


def test_every_job_is_done_and_the_results_are_in_their_order() -> None:
    told: list[tuple[int, int]] = []
    results = do_all([4, 3, 2, 2], half, why, workers=2, progress=lambda done, all: told.append((done, all)))
    assert results == [2.0, "3: 3 is odd", 1.0, 1.0]
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_without_jobs_there_is_nothing_to_do() -> None:
    assert do_all([], half, why, workers=2) == []
