"""Upper confidence bounds."""

from __future__ import annotations

import math

import pytest

from executive.vision.evaluation.bounds import rate_bound, rounded_up, share_bound


def test_a_share_never_seen_is_bounded_by_what_would_rarely_stay_unseen():
    assert share_bound(0, 1344) == pytest.approx(1 - 0.05 ** (1 / 1344))


def test_at_the_bound_of_a_share_so_few_events_would_be_rare():
    bound = share_bound(2, 13)
    below = sum(math.comb(13, k) * bound**k * (1 - bound) ** (13 - k) for k in range(3))
    assert below == pytest.approx(0.05)


@pytest.mark.parametrize(("events", "trials"), [(0, 0), (5, 5)])
def test_a_share_of_which_nothing_contradicts_the_worst_is_bounded_by_one(events, trials):
    assert share_bound(events, trials) == 1.0


@pytest.mark.parametrize(("events", "bound"), [(0, 2.9957), (1, 4.7439), (10, 16.9622), (400, 434.6)])
def test_a_rate_has_the_bound_of_the_tables(events, bound):
    """Garwood's limits, half the 95 % quantile of chi-squared with 2 k + 2 degrees of freedom."""
    assert rate_bound(events, 100) == pytest.approx(bound / 100, rel=1e-3)


def test_a_rate_needs_a_look():
    with pytest.raises(ValueError, match="at least one look"):
        rate_bound(0, 0)


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(0.00222, 0.0023), (0.0022, 0.0022), (0.0, 0.0), (1.31, 1.4), (123.4, 130.0), (0.00997, 0.01)],
)
def test_a_bound_is_rounded_up(value, rounded):
    assert rounded_up(value) == pytest.approx(rounded)
