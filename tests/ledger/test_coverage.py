"""Where something may still be overlooked."""

from __future__ import annotations

import math

import numpy as np
import pytest
from ledger_bench import area_of, take_frame

from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.frame import Detections, ErrorRates
from executive.ledger.coverage import (
    MIN_MISS_PROBABILITY,
    PRIOR_IN_WORKSPACE,
    PRIOR_OUTSIDE_WORKSPACE,
    Coverage,
)

TABLE = TableConfig()
MIDDLE, CORNER = np.array([0.53, 0.0, 0.025]), np.array([0.43, 0.21, 0.025])
EYE = ErrorRates(threshold=0.5, miss_rate=0.2, confusion_rate=0.1, false_detections=0.5, jitter=1.0)


def look(*, view: str = "full", change_count: int = 0, hidden: slice = slice(0, 0)) -> Detections:
    """An empty look from above; the columns `hidden` of the image are behind the arm."""
    return Detections(
        "eye", (), EYE, frame=take_frame(1, change_count, hidden), view=view, area=area_of(view)
    )


@pytest.fixture
def coverage() -> Coverage:
    return Coverage(TABLE)


def test_every_look_leaves_as_much_doubt_as_its_detector_misses(coverage: Coverage) -> None:
    for looks in range(1, 5):
        coverage.update(look())
        assert coverage.find_miss_probability(MIDDLE) == pytest.approx(0.2**looks)
        assert coverage.find_max_object_probability() == pytest.approx(PRIOR_IN_WORKSPACE * 0.2**looks)


def test_one_look_shows_the_surroundings_empty_also_after_a_drop(coverage: Coverage) -> None:
    coverage.update(look())
    coverage.record_change(MIDDLE, math.inf)
    beside = np.array([0.53, 0.40, 0.025])
    assert coverage.find_miss_probability(beside) == PRIOR_OUTSIDE_WORKSPACE
    coverage.update(look(change_count=1))
    assert coverage.find_miss_probability(beside) <= LedgerConfig().max_miss_probability


def test_looks_at_the_workspace_alone_never_show_that_nothing_lies_beside_it(coverage: Coverage) -> None:
    for _ in range(20):
        coverage.update(look(view="table"))
    assert coverage.find_miss_probability(MIDDLE) == MIN_MISS_PROBABILITY, "looks are not wholly independent"
    assert coverage.find_max_object_probability() == 1.0


def test_what_the_arm_hides_is_not_believed_empty(coverage: Coverage) -> None:
    # Columns run against the world's y here: the right half of the image shows one side of the table.
    for _ in range(5):
        coverage.update(look(hidden=slice(320, 640)))
    sides = [coverage.find_miss_probability(np.array([0.53, y, 0.025])) for y in (-0.15, 0.15)]
    assert sorted(sides) == [pytest.approx(0.2**5), 1.0]
    assert coverage.find_max_object_probability() == PRIOR_IN_WORKSPACE


def test_a_change_brings_the_doubt_back_whatever_a_frame_from_before_shows(coverage: Coverage) -> None:
    for _ in range(2):
        coverage.record_change(CORNER, 0.07)
        coverage.update(look(change_count=0))
    assert coverage.find_miss_probability(CORNER) == 1.0
    assert coverage.find_miss_probability(MIDDLE) == pytest.approx(0.2**2)


@pytest.mark.parametrize(
    ("place", "inside"),
    [((0.53, 0.0), True), ((0.41, 0.24), True), ((0.38, 0.0), False), ((0.53, 0.26), False)],
)
def test_the_workspace_reaches_as_far_as_half_an_object_over_its_edge(
    coverage: Coverage, place: tuple[float, float], inside: bool
) -> None:
    assert coverage.is_in_workspace(np.array([*place, 0.03])) is inside


@pytest.mark.parametrize(
    ("y", "counts"),
    [(0.0, True), (0.24, True), (0.33, True), (0.345, False), (0.40, False)],
    ids=["workspace", "its rim", "beside it", "at the edge of what the arm hides", "hidden"],
)
def test_a_place_counts_if_all_places_around_it_do(coverage: Coverage, y: float, counts: bool) -> None:
    coverage.update(look(hidden=slice(0, 174)))
    assert coverage.is_visible(np.array([0.53, y, 0.025])) is counts
