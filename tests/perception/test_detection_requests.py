"""Detections run beside the tick loop and show on the run's clock."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from executive.cell.frame import Answer, Detection, ErrorRates
from executive.errors import DeadlinePassed
from executive.perception.detectors.requests import PendingSearch

FOUND = [Detection("cube", 0.9, (0.0, 0.0, 1.0, 1.0))]
ERROR_RATES = ErrorRates(threshold=0.5, miss_rate=0.1, confusion_rate=0.1, false_detections=0.1, jitter=1.0)


@pytest.fixture
def clock():
    return SimpleNamespace(now=0.0)


@pytest.fixture
def ended(clock):
    """Returns a request, due at 0.05 s, whose search has ended with detections or an error."""

    def end(result, **options):
        work = Future()
        (work.set_exception if isinstance(result, Exception) else work.set_result)(result)
        return PendingSearch(work, 0.05, clock, "eye", ERROR_RATES, **options)

    return end


def test_an_answer_that_is_in_early_shows_only_when_it_is_due(ended, clock):
    request = ended(FOUND)
    assert not request.ready
    with pytest.raises(RuntimeError, match=r"due at 0\.050 s, and the time is 0\.000 s"):
        request.result()
    clock.now = 0.05 - 1e-12
    assert request.ready
    assert request.result() == Answer("eye", tuple(FOUND), ERROR_RATES)


def test_the_clock_waits_for_an_answer_that_is_late(clock):
    release = threading.Event()
    clock.now = 0.05
    with ThreadPoolExecutor(1) as thread:
        request = PendingSearch(thread.submit(release.wait), 0.05, clock, "eye", ERROR_RATES)
        threading.Timer(0.08, release.set).start()
        assert request.ready
        assert release.is_set()


def test_what_the_search_raises_comes_out_of_the_result_as_it_is(ended, clock):
    request = ended(ZeroDivisionError("a bug"), expiry_time=1.0)
    clock.now = 0.05
    assert request.ready
    with pytest.raises(ZeroDivisionError):
        request.result()


def test_that_a_deadline_has_passed_shows_when_it_has_passed_on_the_runs_clock_too(ended, clock):
    request = ended(DeadlinePassed("no answer within 1.0 s"), expiry_time=1.0)
    clock.now = 0.9
    assert not request.ready
    clock.now = 1.0 - 1e-12
    assert request.ready
    with pytest.raises(DeadlinePassed, match=r"within 1\.0 s"):
        request.result()
