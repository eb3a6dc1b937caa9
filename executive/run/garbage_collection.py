"""Python's garbage collection during the start of a command and during the control steps of a run."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

START_THRESHOLD = 100_000
"""Number of new objects after which Python collects garbage during the start of a command.

The number is large, because imports create many objects that remain."""
CONTROL_THRESHOLD = 700
"""Number of new objects after which Python collects garbage between control steps: the default of Python."""


@contextmanager
def shorten_collections() -> Iterator[None]:
    """Exclude all existing objects from garbage collection until the context ends.

    Otherwise a collection of all objects would take 0.1 s of a control step.
    """
    start_threshold, *_ = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(CONTROL_THRESHOLD)
    try:
        yield
    finally:
        gc.set_threshold(start_threshold)
        gc.unfreeze()
