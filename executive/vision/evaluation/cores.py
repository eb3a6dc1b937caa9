"""Measuring as on a computer with fewer processor cores."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import cv2

from executive.errors import InputError


@contextlib.contextmanager
def only_cores(count: int | None) -> Iterator[None]:
    """Let this thread, and every thread and process begun meanwhile, run on `count` cores only; None: on all.

    What was begun before keeps its cores: the detector must be built inside.

    Raises:
        InputError: There are not so many, or the system cannot do it.
    """
    if count is None:
        yield
        return
    if not hasattr(os, "sched_setaffinity"):
        raise InputError("this system cannot limit a process to some cores; measure without --cores")
    all_cores = os.sched_getaffinity(0)
    if count > len(all_cores):
        raise InputError(f"there are {len(all_cores)} processor cores here, not {count}; ask for fewer")
    threads = cv2.getNumThreads()
    os.sched_setaffinity(0, sorted(all_cores)[-count:])
    cv2.setNumThreads(count)
    try:
        yield
    finally:
        os.sched_setaffinity(0, all_cores)
        cv2.setNumThreads(threads)
