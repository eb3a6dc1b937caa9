"""The figures that a detector's section of a cell file states."""

from __future__ import annotations

import pytest
import yaml

from executive.cell_config import DetectorConfig
from executive.vision.evaluation.reliability import MeasuredReliability, round_up


def test_a_cell_file_is_advised_to_state_upper_bounds_with_what_was_counted():
    measured = MeasuredReliability.of(
        whole=1344, overlooked=0, confused=2, invented=1, looks=300, jitter=0.432
    )
    assert measured.yaml().splitlines() == [
        "misses: 0.0023    # 0 of 1344 objects in full view; upper 95 % bound",
        "confused: 0.0047  # 2 of 1344 found; upper 95 % bound",
        "invented: 0.016   # 1 in 300 looks; upper 95 % bound",
        "jitter: 0.44      # pixels of the frame, as measured",
    ]


@pytest.mark.parametrize("whole", [0, 5])
def test_a_cell_file_takes_what_it_is_advised_to_state_also_at_the_extremes(whole):
    measured = MeasuredReliability.of(
        whole=whole, overlooked=whole, confused=0, invented=0, looks=1, jitter=0.0
    )
    config = DetectorConfig(kind="embedded", **yaml.safe_load(measured.yaml()))
    assert (config.misses, config.confused, config.jitter) == (0.99, 0.99, 0.01)
    assert config.invented == 3.0


def bounds(whole, overlooked, invented, looks):
    measured = MeasuredReliability.of(
        whole=whole, overlooked=overlooked, confused=0, invented=invented, looks=looks, jitter=0.1
    )
    return measured.misses.bound, measured.invented.bound


def test_the_bounds_are_those_of_the_tables():
    """Clopper and Pearson's, and Garwood's: half the 95 % quantile of chi-squared with 2 k + 2 degrees."""
    assert bounds(1344, 0, 0, 100) == pytest.approx((1 - 0.05 ** (1 / 1344), 0.029957), rel=1e-4)
    assert bounds(13, 2, 10, 100) == pytest.approx((0.410099, 0.169622), rel=1e-4)
    assert bounds(5, 5, 400, 100) == pytest.approx((1.0, 4.346), rel=1e-3)


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(0.00222, 0.0023), (0.0022, 0.0022), (0.0, 0.0), (1.31, 1.4), (123.4, 130.0), (0.00997, 0.01)],
)
def test_a_bound_is_rounded_up(value, rounded):
    assert round_up(value) == pytest.approx(rounded)
