"""Wait for the result of another thread that leaves time for signals such as Ctrl-C."""

from __future__ import annotations

from concurrent.futures import Future, wait
from typing import TypeVar

T = TypeVar("T")

MAX_BLOCKING_TIME = 0.05
"""Maximum uninterrupted wait for another thread [s], which is the maximum delay of a second Ctrl-C."""


def wait_until_done(future: Future[T]) -> None:
    """Wait until another thread has computed a result or raised an exception."""
    while not future.done():
        wait([future], MAX_BLOCKING_TIME)
