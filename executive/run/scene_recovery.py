"""Recovery of the scene in a resumed run whose journal lacks the last actions of the tool."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.detection import Detections
from executive.cell.frame import Frame
from executive.cell.objects import Load
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked, Fault, NoDepth, Unavailable, Unreachable
from executive.manipulation.tool_goals import DROP_HEIGHT, list_obstacles, make_put_down_goal

LOOKS_PER_POSE = 3
"""Number of looks from each camera pose; a look is one image with its detections."""
MIN_LOOKS = 5
"""Minimum number of looks from all scan poses together."""
VACUUM_DECAY_TIME = 0.1
"""Time for the vacuum to decay after the tool opened [s]."""


def recover_scene(cell: Cell) -> Steps:
    """Empty the tool, and observe the table and the bins.

    A camera on the arm also observes each bin from above. The ledger then knows the place of each detected
    item; the mission searches for the other items.

    Raises:
        Fault: The tool holds an object that cannot be put down.
    """
    cell.ledger.record_interruption()
    if cell.tool.holding:
        yield from _put_down(cell)
    cell.tool.open()
    yield from cell.clock.sleep(VACUUM_DECAY_TIME)
    poses = cell.camera.scan_poses
    first_camera_position, max_tool_height = cell.camera.capture().X_WC.position, 0.0
    is_camera_on_arm = False
    for look_index in range(max(MIN_LOOKS, LOOKS_PER_POSE * len(poses))):
        frame = yield from _look(cell, poses[look_index % len(poses)])
        is_camera_on_arm |= not np.allclose(first_camera_position, frame.X_WC.position)
        max_tool_height = max(max_tool_height, float(cell.arm.tool_pose.position[2]))
        if look_index == 0:
            cell.ledger.mark_unseen_as_dropped()
    for bin in cell.bins.values() if is_camera_on_arm else ():
        x, y, _ = map(float, bin.position)
        for _ in range(LOOKS_PER_POSE):
            yield from _look(cell, Goal((x, y, max_tool_height)))
    cell.ledger.record_bin_contents()


def _put_down(cell: Cell) -> Steps:
    """Transport the object in the tool, whose class is unknown, to a free position on the table."""
    tallest_class = max(cell.classes.values(), key=lambda object_class: object_class.height)
    goal = make_put_down_goal(cell, tallest_class, DROP_HEIGHT, None)
    problems = []
    # The tallest load may collide at the start although the real load does not; the second plan has no load.
    for load in (Load(tallest_class, cell.tool.holding_force), None):
        try:
            yield from _move(cell, goal, Task(load, list_obstacles(cell)))
        except (Unreachable, Blocked) as error:
            problems.append(str(error))
        else:
            return
    raise Fault(
        f"the tool holds an object that cannot be put down: {problems[0]}; take it out of the tool and "
        "resume the run again"
    )


def _look(cell: Cell, goal: Goal | str) -> Generator[None, None, Frame]:
    """Move to a goal if possible, update the ledger from the whole camera image, and return the frame."""
    with suppress(Unreachable, Blocked):
        yield from _move(cell, goal, Task(obstacles=list_obstacles(cell)))
    frame = cell.camera.capture()
    request = next(iter(cell.detectors.values())).request(frame, "full")
    while not request.ready:
        yield
    try:
        answer = request.result()
        area = cell.camera.get_view_box("full")
        detections = Detections(**vars(answer), frame=frame, view="full", area=area)
        observations = cell.localizer.localize(detections)
    except (Unavailable, NoDepth):
        return frame
    # A look of a displaced camera is ignored; a skill of the mission reports the displacement later.
    if not cell.camera.describe_displacement(frame):
        cell.ledger.observe(detections, observations)
    return frame


def _move(cell: Cell, goal: Goal | str, task: Task) -> Steps:
    """Move the arm to a goal, and yield until the arm is at rest, at the goal or after a collision.

    Raises:
        Unreachable, Blocked: The planner found no motion.
    """
    planning = cell.arm.plan(goal, task)
    while not planning.ready:
        yield
    cell.arm.start(planning.result())
    while not cell.arm.at_rest:
        yield
    if cell.arm.collision is not None:
        cell.ledger.record_collision(cell.arm.contact_point)
