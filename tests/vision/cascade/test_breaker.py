"""Who fails again and again is left alone for a while."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from executive.vision.detectors.cascade.breaker import Breaker

EVENTS = st.lists(
    st.tuples(st.integers(0, 8), st.sampled_from(["answer", "failure", "silence"])), max_size=60
)
"""Time that passes before somebody wants to ask, and what comes of it if they may."""


@given(EVENTS, st.integers(1, 4), st.integers(1, 12))
def test_it_keeps_to_its_rule_whatever_happens(events, failures, rest):
    breaker = Breaker(failures, rest)
    now = in_a_row = last = 0
    for wait, outcome in events:
        now += wait
        expected = in_a_row < failures or now - last >= rest
        assert breaker.admits(now) is expected
        if not expected:
            continue
        if in_a_row >= failures:
            last = now
        if outcome == "answer":
            breaker.succeeded()
            in_a_row = 0
        elif outcome == "failure":
            breaker.failed(now)
            in_a_row, last = in_a_row + 1, now


def test_it_opens_with_the_last_failure_that_is_one_too_many():
    breaker = Breaker(failures=2, rest=10.0)
    breaker.failed(1.0)
    assert not breaker.is_open
    assert breaker.admits(1.0)
    breaker.failed(2.0)
    assert breaker.is_open
    assert (breaker.failures, breaker.next_trial) == (2, 12.0)


def test_failures_count_in_a_row_only():
    breaker = Breaker(failures=2, rest=10.0)
    breaker.failed(1.0)
    breaker.succeeded()
    breaker.failed(2.0)
    assert not breaker.is_open


def test_after_the_rest_there_is_one_trial_and_an_answer_closes_it():
    breaker = Breaker(failures=1, rest=10.0)
    breaker.failed(0.0)
    assert not breaker.admits(9.9)
    assert breaker.admits(10.0)
    assert not breaker.admits(10.0)
    breaker.succeeded()
    assert breaker.admits(10.1)


def test_a_trial_that_nobody_waits_for_does_not_shut_it_for_ever():
    breaker = Breaker(failures=1, rest=10.0)
    breaker.failed(0.0)
    assert breaker.admits(10.0)
    assert not breaker.admits(19.9)
    assert breaker.admits(20.0)
