"""Detections run beside the tick loop and show on the run's clock."""

from __future__ import annotations

import threading

import pytest

from executive.errors import DeadlinePassed, Unavailable
from executive.messages import Answer, Detection, Reliability
from executive.vision.detectors.requests import Pending, Worker

FOUND = [Detection("cube", 0.9, (0.0, 0.0, 1.0, 1.0))]
RELIABILITY = Reliability(threshold=0.5, misses=0.1, confused=0.1, invented=0.1, jitter=1.0)
ANSWER = Answer("eye", tuple(FOUND), RELIABILITY)


class Clock:
    def __init__(self):
        self.now = 0.0
        self.step = 1 / 240

    def sleep(self, duration):
        yield


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def worker():
    worker = Worker("test")
    yield worker
    worker.close()


def pending(worker, search, due, clock, **options):
    return Pending(worker.submit(search), due, clock, detector="eye", reliability=RELIABILITY, **options)


def test_an_answer_that_is_in_early_shows_only_when_it_is_due(worker, clock):
    request = pending(worker, lambda: FOUND, 0.05, clock)
    worker.submit(list).result()
    assert not request.ready
    with pytest.raises(RuntimeError, match=r"due at 0\.050 s and it is 0\.000 s"):
        request.result()
    clock.now = 0.05 - 1e-12
    assert request.ready
    assert request.result() == ANSWER


def test_the_clock_waits_for_an_answer_that_is_late(worker, clock):
    release = threading.Event()

    def search():
        release.wait()
        return FOUND

    request = pending(worker, search, 0.05, clock)
    clock.now = 0.05
    threading.Timer(0.08, release.set).start()
    assert request.ready
    assert release.is_set()


@pytest.mark.parametrize("error", [Unavailable("the model is gone"), ZeroDivisionError("a bug")])
def test_what_the_search_raises_comes_out_of_the_result_as_it_is(worker, clock, error):
    def search():
        raise error

    request = pending(worker, search, 0.05, clock, given_up=1.0)
    clock.now = 0.05
    assert request.ready
    with pytest.raises(type(error)) as raised:
        request.result()
    assert raised.value is error


def test_that_a_deadline_has_passed_shows_when_it_has_passed_on_the_runs_clock_too(worker, clock):
    def search():
        raise DeadlinePassed("no answer within 1.0 s")

    request = pending(worker, search, 0.05, clock, given_up=1.0)
    clock.now = 0.9
    assert not request.ready
    clock.now = 1.0 - 1e-12
    assert request.ready
    with pytest.raises(DeadlinePassed, match=r"within 1\.0 s"):
        request.result()


def test_closing_ends_the_thread():
    worker = Worker("closing")
    worker.submit(list).result()
    worker.close()
    assert not any(thread.name.startswith("detector-closing") for thread in threading.enumerate())
