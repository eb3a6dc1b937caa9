"""Nobody waits for ever for a skill: what does not come back is broken off, and where it was is told."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from traceback import walk_stack
from types import FrameType

from executive.skill import Skill
from executive.testing.conformance.source import place_in

PATIENCE = 10.0
"""Time by the wall clock after which what gets no further is believed to be stuck [s]."""

LOOKS = 2
"""Looks in this time: a machine that slept has let one pass at most."""

_SOON = 1e-3
"""When another's timer goes off whose time was over meanwhile [s]."""


class Stuck(BaseException):
    """What belongs to a skill did not come back; the text, to follow its name, says for how long and where.

    It is no Exception, so that a skill that catches those is broken off like any other.
    """


@contextmanager
def patience(skill: type[Skill], progress: Callable[[], object]) -> Iterator[None]:
    """Break off what is done inside as soon as `progress` returns the same for `PATIENCE`.

    The run's clock stands still meanwhile, so this is the wall clock's. Python hands signals to its main
    thread alone: in another one nothing is broken off.

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
            raise Stuck(f"did not come back for {PATIENCE:g} s{where and f', at {where}'}")

    began = monotonic()
    answered = signal.signal(signal.SIGALRM, look)
    left, interval = signal.setitimer(signal.ITIMER_REAL, PATIENCE / LOOKS, PATIENCE / LOOKS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, answered or signal.SIG_DFL)
        if left:
            # Somebody else waits too, for a whole test for instance; that time has not stood still.
            signal.setitimer(signal.ITIMER_REAL, max(_SOON, left - (monotonic() - began)), interval)
