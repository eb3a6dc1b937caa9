"""The subtrees of the library outlast the restart of a detection server, and a collision in a look aside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.events import FaultInjected, FrameSearched, MotionPlanned, ToolCommanded
from executive.testing.faults import (
    ScheduledFault,
    after,
    arm_collides,
    between,
    detector_dead,
    detector_unsure,
    during,
)
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


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 4.0])
@pytest.mark.parametrize("duration", [15.0, LONGEST_RESTART])
def test_a_sort_outlasts_the_restart_of_a_server(start: float, duration: float) -> None:
    restart = between(start, start + duration, detector_dead())
    result = run_mission("sort_overhead", seed=1, faults=[restart])
    assert (result.status, result.message) == ("SUCCESS", "")
    assert result.audit is not None
    assert result.agrees
    assert result.items["placed"] == result.audit["right"] == result.items["seen"] >= 3
    assert result.robot_time > start + duration


def test_the_last_look_needs_no_motion_and_is_later_than_the_last_release() -> None:
    result = run_mission("sort_overhead", seed=1)
    events = [one.event for one in result.events]
    last_release = max(number for number, event in enumerate(events) if isinstance(event, ToolCommanded))
    rest = events[last_release:]
    assert result.status == "SUCCESS"
    assert [event.view for event in rest if isinstance(event, FrameSearched)] == ["full"]
    assert not [event for event in rest if isinstance(event, MotionPlanned)]


COLLISION = during("*second*/do/MoveToScan", arm_collides(), activations=1)
COLLISION_OF_RECOVERY = during("*second*/recover/*/MoveToScan", arm_collides(), activations=1)


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["next", "aside"])
@pytest.mark.parametrize(
    "faults",
    [
        [COLLISION],
        [COLLISION, COLLISION_OF_RECOVERY],
        [during("*second*/Detect", detector_dead(), activations=1)],
        [during("*second*/Detect", detector_unsure(), activations=1)],
    ],
    ids=["collision", "two collisions", "dead detector", "unsure detector"],
)
def test_after_a_failed_attempt_look_aside_looks_from_the_same_pose(
    tmp_path: Path, pose: str, faults: list[ScheduledFault]
) -> None:
    mission = tmp_path / "look_twice.yaml"
    mission.write_text(
        "mission: look_twice\n"
        "cell: cells/overhead.yaml\n"
        "library: library/sorting.yaml\n"
        "tree:\n"
        "  - {use: look_aside, as: first, with: {pose: next}}\n"
        f"  - {{use: look_aside, as: second, with: {{pose: {pose}}}}}\n"
    )
    undisturbed, disturbed = run_mission(mission), run_mission(mission, faults=faults)
    assert len(disturbed.list_activated_nodes("*second*/Localize")) == 1
    assert disturbed.cell.cell.arm.q == pytest.approx(undisturbed.cell.cell.arm.q)
