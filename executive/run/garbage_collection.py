"""Python's garbage collection during start-up and during the control steps of a run."""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager

START_THRESHOLD = 100_000
"""Number of new objects after which Python collects garbage during the start of a command."""
CONTROL_THRESHOLD = 700
"""Number of new objects after which Python collects garbage between control steps: the default of Python."""


def reduce_collections() -> None:
    """Let Python collect garbage less often during the start, as imports create many objects that remain."""
    gc.set_threshold(START_THRESHOLD)


def omit_final_collection() -> None:
    """Let Python collect no garbage at the end of the process, which saves 0.1 s.

    A process that has planned motions must not call this function: ruckig would report its objects as leaks.
    """
    atexit.register(gc.freeze)


@contextmanager
def shorten_collections() -> Iterator[None]:
    """Exclude all existing objects from garbage collection until the context ends.

    Otherwise a collection of all objects would take 0.1 s of a control step.
    """
    threshold, *others = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(CONTROL_THRESHOLD, *others)
    try:
        yield
    finally:
        gc.set_threshold(threshold, *others)
        gc.unfreeze()
