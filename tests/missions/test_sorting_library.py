"""The subtrees of the library outlast the restart of a detection server, and a collision in a look aside."""

from __future__ import annotations

import numpy as np
import pytest

from executive.events import FaultInjected, FrameSearched, MotionPlanned, ToolCommanded
from executive.testing.faults import after, detector_dead
from executive.testing.run_mission import run_mission

LONGEST_RESTART = 40.0
"""Longest measured time in which a restarted detection server gives no answer [s]; the shortest is 15 s."""
MAX_TOTAL_WAIT = 70.0
"""Longest time that a look may wait for a server that never answers [s]."""


def test_the_waits_of_a_look_grow_and_outlast_a_restart() -> None:
    result = run_mission("sort_overhead", faults=[after(0.0, detector_dead())])
    assert (result.status, result.reason) == ("FAILURE", "Detect.unavailable")
    asked = [one.clock for one in result.events if isinstance(one.event, FaultInjected)]
    waits = np.diff(asked)
    # Each answer shows 0.05 s after its frame.
    assert waits - 0.05 == pytest.approx([1, 2, 4, 8, 8, 8, 8, 8, 8], abs=0.02)
    assert LONGEST_RESTART < waits.sum() < MAX_TOTAL_WAIT


def test_the_last_look_needs_no_motion_and_is_later_than_the_last_release() -> None:
    result = run_mission("sort_overhead", seed=1)
    events = [one.event for one in result.events]
    last_release = max(number for number, event in enumerate(events) if isinstance(event, ToolCommanded))
    rest = events[last_release:]
    assert result.status == "SUCCESS"
    assert [event.view for event in rest if isinstance(event, FrameSearched)] == ["full"]
    assert not [event for event in rest if isinstance(event, MotionPlanned)]
