"""Wait for the result of another thread, with interruptions in which Python handles signals."""

from __future__ import annotations

from concurrent.futures import Future, wait
from typing import TypeVar

T = TypeVar("T")

MAX_BLOCKING_TIME = 0.05
"""Maximum uninterrupted wait for another thread [s]; within this time, Python handles a signal, for example
a second Ctrl-C, which ends the process at once."""


def wait_until_done(future: Future[T]) -> None:
    """Wait until another thread has computed a result or raised an exception."""
    while not future.done():
        wait([future], MAX_BLOCKING_TIME)
