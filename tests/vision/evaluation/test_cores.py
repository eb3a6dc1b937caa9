"""Measuring with fewer processor cores."""

from __future__ import annotations

import os
import threading

import cv2
import pytest

from executive.errors import InputError
from executive.vision.evaluation.cores import only_cores

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system cannot limit cores")


def test_threads_begun_meanwhile_run_on_so_many_cores_and_later_ones_on_all():
    before, threads, inside = os.sched_getaffinity(0), cv2.getNumThreads(), []
    with only_cores(1):
        assert cv2.getNumThreads() == 1
        thread = threading.Thread(target=lambda: inside.append(os.sched_getaffinity(0)))
        thread.start()
        thread.join()
        with only_cores(None):
            assert len(os.sched_getaffinity(0)) == 1
    assert len(inside[0]) == 1
    assert os.sched_getaffinity(0) == before
    assert cv2.getNumThreads() == threads


def test_more_cores_than_there_are_is_explained():
    with pytest.raises(InputError, match=r"processor cores here, not 4096; ask for fewer"), only_cores(4096):
        pass
