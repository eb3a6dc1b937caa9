"""Detections run beside the tick loop and show on the run's clock."""

from __future__ import annotations

import threading

import pytest

from executive.errors import Unavailable
from executive.messages import Detection
from executive.vision.detectors.requests import Worker

ANSWER = [Detection("cube", 0.9, (0.0, 0.0, 1.0, 1.0))]


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


def test_an_answer_that_is_in_early_shows_only_when_it_is_due(worker, clock):
    request = worker.submit(lambda: ANSWER, 0.05, clock)
    worker.submit(list, 0.0, clock).result()
    assert not request.ready
    clock.now = 0.05 - 1e-12
    assert request.ready
    assert request.result() == ANSWER


def test_the_clock_waits_for_an_answer_that_is_late(worker, clock):
    release = threading.Event()

    def search():
        release.wait()
        return ANSWER

    request = worker.submit(search, 0.05, clock)
    clock.now = 0.05
    threading.Timer(0.08, release.set).start()
    assert request.ready
    assert release.is_set()


def test_asking_too_early_says_when_the_answer_is_due(worker, clock):
    request = worker.submit(lambda: ANSWER, 0.05, clock)
    with pytest.raises(RuntimeError, match=r"due at 0\.050 s and it is 0\.000 s"):
        request.result()


@pytest.mark.parametrize("error", [Unavailable("the model is gone"), ZeroDivisionError("a bug")])
def test_what_the_search_raises_comes_out_of_the_result_as_it_is(worker, clock, error):
    def search():
        raise error

    request = worker.submit(search, 0.0, clock)
    assert request.ready
    with pytest.raises(type(error)) as raised:
        request.result()
    assert raised.value is error


def test_closing_ends_the_thread():
    worker = Worker("closing")
    worker.submit(list, 0.0, Clock()).result()
    worker.close()
    assert not any(thread.name.startswith("detector-closing") for thread in threading.enumerate())
