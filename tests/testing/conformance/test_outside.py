"""What a skill does behind the cell's back is seen."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from executive.testing.conformance.outside import clocks_watched, open_things


@contextmanager
def a_thread() -> Iterator[str]:
    done = threading.Event()
    thread = threading.Thread(target=done.wait, name="poller")
    thread.start()
    yield 'the thread "poller"'
    done.set()
    thread.join()


@contextmanager
def a_file() -> Iterator[str]:
    with open(os.devnull):
        yield "the open file /dev/null"


@contextmanager
def a_process() -> Iterator[str]:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE):
        yield "the process python"


@pytest.mark.parametrize("left", [a_thread, a_file, a_process])
def test_what_is_left_open_is_told_by_name(left) -> None:
    before = open_things()
    with left() as name:
        assert [thing for thing in open_things() - before if thing.startswith(name)]
    assert open_things() == before


def test_who_asks_the_wall_clock_is_told_and_answered() -> None:
    seen: list[str] = []
    with clocks_watched(seen):
        now = time.monotonic()
    assert now <= time.monotonic()
    assert len(seen) == 1
    assert seen[0].startswith("time.monotonic in test_outside.py:")


def test_nobody_sleeps_under_watch() -> None:
    seen: list[str] = []
    began = time.monotonic()
    with clocks_watched(seen):
        time.sleep(1000.0)
    assert time.monotonic() - began < 100.0
    assert seen[0].startswith("time.sleep in test_outside.py:")


def test_a_log_may_ask_what_time_it_is(caplog: pytest.LogCaptureFixture) -> None:
    seen: list[str] = []
    with clocks_watched(seen):
        logging.getLogger("executive").warning("a word")
    assert caplog.messages == ["a word"]
    assert seen == []


def test_other_threads_may_ask_the_wall_clock() -> None:
    seen: list[str] = []
    with clocks_watched(seen):
        thread = threading.Thread(target=lambda: time.time())
        thread.start()
        thread.join()
    assert seen == []


def test_the_clocks_are_the_true_ones_afterwards() -> None:
    true = time.time, time.sleep
    with pytest.raises(KeyError), clocks_watched([]):
        raise KeyError
    assert (time.time, time.sleep) == true
