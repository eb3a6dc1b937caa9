"""The wait before another attempt."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import make_backoff, retry
from py_trees.common import Status

from executive.tree.retry import Backoff, Retry


@pytest.mark.parametrize(
    ("backoff", "delays"),
    [
        (make_backoff(0.5), [0.5, 0.5, 0.5, 0.5]),
        (make_backoff(0.5, 2), [0.5, 1.0, 2.0, 4.0]),
        (make_backoff(0.5, 3, max=2.0), [0.5, 1.5, 2.0, 2.0]),
        (make_backoff(3.0, max=2.0), [2.0, 2.0, 2.0, 2.0]),
    ],
)
def test_waits_grow_by_the_factor_up_to_the_most(backoff: Backoff, delays: list[float]) -> None:
    assert [backoff.compute_delay(attempt) for attempt in range(1, 5)] == delays


@pytest.mark.parametrize("factor", [2, 2.0])
def test_no_number_of_attempts_is_too_large(factor: float) -> None:
    assert make_backoff(0.5, factor, max=8.0).compute_delay(100_000) == 8.0


def runs(node: Retry, clock: Any, times: list[float]) -> str:
    """Tick at these times and return every status by its first letter."""
    seen = ""
    for clock.now in times:
        node.tick_once()
        seen += node.status.value[0]
    return seen


def test_a_retry_waits_on_the_clock_then_recovers_then_tries_again(
    leaf: Any, site: Any, clock: Any, log: Any
) -> None:
    body, fix = leaf("A", "R lost", "S"), leaf("fix", "R S")
    node = retry(site(), body, 3, [], fix, make_backoff(0.5), clock)
    assert (runs(node, clock, [0.0, 0.125, 0.25, 0.5]), log) == ("RRRR", ["A starts"])
    assert (body.status, fix.status) == (Status.FAILURE, Status.INVALID)
    # Half a second after the failure at 0.125 s.
    assert (runs(node, clock, [0.625]), log) == ("R", ["A starts", "fix starts"])
    assert (runs(node, clock, [0.75]), log) == ("S", ["A starts", "fix starts", "A starts"])


def test_every_wait_is_the_next_one_of_the_backoff(leaf: Any, site: Any, clock: Any, log: Any) -> None:
    node = retry(site(), leaf("A", "lost"), 4, [], None, make_backoff(0.25, 2, max=0.75), clock)
    began = []
    for tick in range(20):
        clock.now = tick * clock.step
        before = len(log)
        node.tick_once()
        began += [clock.now] * (len(log) - before)
        if node.status is Status.FAILURE:
            break
    assert (began, clock.now) == ([0.0, 0.25, 0.75, 1.5], 1.5)


def test_the_wait_is_reported_and_shown_in_the_detail(leaf: Any, site: Any, clock: Any, events: Any) -> None:
    node = retry(site(), leaf("A", "lost"), 3, [("A", "lost")], None, make_backoff(0.5, 2, 8), clock)
    node.tick_once()
    assert (events[-1].choice, events[-1].reason) == ("attempt 2 of 3 in 0.5 s", "A.lost")
    assert node.detail == "up to 3 attempts, on A.lost, backoff 0.5 s, factor 2, at most 8 s"
