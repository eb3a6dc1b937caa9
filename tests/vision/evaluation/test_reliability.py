"""The figures that a detector's section of a cell file states."""

from __future__ import annotations

import pytest
import yaml

from executive.cell_config import DetectorConfig
from executive.vision.evaluation.reliability import MeasuredReliability, round_up


def measured(whole, overlooked, confused, invented, looks, jitter):
    return MeasuredReliability.of(
        whole=whole, overlooked=overlooked, confused=confused, invented=invented, looks=looks, jitter=jitter
    )


def test_a_cell_file_is_advised_to_state_upper_bounds_with_what_was_counted():
    assert measured(1344, 0, 2, 1, 300, 0.432).yaml().splitlines() == [
        "misses: 0.0023    # 0 of 1344 objects in full view; upper 95 % bound",
        "confused: 0.0047  # 2 of 1344 found; upper 95 % bound",
        "invented: 0.016   # 1 in 300 looks; upper 95 % bound",
        "jitter: 0.44      # pixels of the frame, as measured",
    ]


@pytest.mark.parametrize("whole", [0, 5])
def test_a_cell_file_takes_what_it_is_advised_to_state_also_at_the_extremes(whole):
    stated = yaml.safe_load(measured(whole, whole, 0, 0, 1, 0.0).yaml())
    config = DetectorConfig(kind="embedded", **stated)
    assert (config.misses, config.confused, config.invented, config.jitter) == (0.99, 0.99, 3.0, 0.01)


@pytest.mark.parametrize(
    ("whole", "overlooked", "invented", "expected"),
    [
        (1344, 0, 0, (1 - 0.05 ** (1 / 1344), 0.029957)),
        (13, 2, 10, (0.410099, 0.169622)),
        (5, 5, 400, (1.0, 4.344968)),
    ],
)
def test_the_bounds_are_those_of_the_tables(whole, overlooked, invented, expected):
    """Clopper and Pearson's, and Garwood's: half the 95 % quantile of chi-squared with 2 k + 2 degrees."""
    found = measured(whole, overlooked, 0, invented, 100, 0.1)
    assert (found.misses.bound, found.invented.bound) == pytest.approx(expected, rel=1e-4)


def test_a_bound_is_rounded_up():
    values = [0.00222, 0.0022, 0.0, 1.31, 123.4, 0.00997]
    assert [round_up(value) for value in values] == pytest.approx([0.0023, 0.0022, 0.0, 1.4, 130.0, 0.01])
