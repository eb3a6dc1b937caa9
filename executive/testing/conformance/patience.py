"""A limit on the time that a skill may take to answer, by the wall clock."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from traceback import walk_stack
from types import FrameType

from executive.skill import Skill
from executive.testing.conformance.source import place_in

STUCK_TIMEOUT = 10.0
"""Time by the wall clock after which a skill that gets no further is stuck [s]."""

LOOKS = 2
"""Number of looks in this time: a machine that slept has let one pass at most."""


class Stuck(BaseException):
    """A skill did not come back; the text, to follow its name, says for how long and where.

    It is no Exception, so that a skill that catches those is broken off like any other.
    """


@contextmanager
def patience(skill: type[Skill], progress: Callable[[], object]) -> Iterator[None]:
    """Break off what is done inside as soon as `progress` returns the same for `STUCK_TIMEOUT`.

    Python hands signals to its main thread alone: in another one nothing is broken off.

    Raises:
        Stuck: It was broken off.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last, looks = progress(), 0

    def look(_: int, frame: FrameType | None) -> None:
        nonlocal last, looks
        now = progress()
        looks, last = (looks + 1 if now == last else 0), now
        if looks >= LOOKS:
            where = place_in(skill, ((f.f_code.co_filename, line) for f, line in walk_stack(frame)))
            raise Stuck(f"did not come back for {STUCK_TIMEOUT:g} s{where and f', at {where}'}")

    answered = signal.signal(signal.SIGALRM, look)
    before = signal.setitimer(signal.ITIMER_REAL, STUCK_TIMEOUT / LOOKS, STUCK_TIMEOUT / LOOKS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, answered or signal.SIG_DFL)
