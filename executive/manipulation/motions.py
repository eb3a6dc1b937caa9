"""Loops of skills: looks (capture, detect, localize, observe) and motions (plan, follow, watch)."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from typing import TypeVar

import numpy as np

from executive.cell.arm import Arm, Goal, Motion, MotionGuard, Task
from executive.cell.frame import Detections, Observation
from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked, Crowded, NoDepth, Unavailable, Unreachable, WrongImage
from executive.geometry import GRAVITY, Array
from executive.manipulation.tool_goals import list_obstacles, make_obstacle
from executive.skill import Skill, SkillFailed

T = TypeVar("T")
"""Type of the result of a loop."""
MIN_LOAD_DEVIATIONS = 5.0
"""Minimum distance of the load of an item, and of no item, from half of the weight of the item, in standard
deviations; the load is no evidence about lighter items."""
MAX_ARRIVAL_ERROR = 0.02
"""Maximum distance between the tool and the goal of a transport that was not interrupted [m]."""
LOAD_CHECK_TIME = 0.1
"""Time between two readings of the load, and between closing the tool and reading its sensor [s]."""
FINGER_CHECK_TIME = 0.05
"""Time in which fingers at rest keep their distance [s]."""
MAX_OPENING_CHANGE = 5e-4
"""Maximum change of the distance between fingers at rest in this time [m]."""
MAX_FINGER_CHECK_COUNT = 100
"""Maximum number of such checks; a broken sensor may never show fingers at rest."""
MAX_PLANNING_ATTEMPTS = 3
"""Maximum number of planning attempts for one motion; an update of the ledger may change goal or task."""


def capture_and_detect(cell: Cell, detector: str, view: str) -> Generator[None, None, Detections]:
    """Capture a frame, yield until the detector has answered, and return its detections.

    Args:
        cell: The work cell.
        detector: Name of the detector; "": the first detector of the cell.
        view: The searched part of the frame: `table` or `full`.

    Raises:
        SkillFailed: `wrong_image`, `frozen`, `camera_moved`, `crowded` or `unavailable`.
    """
    try:
        frame = cell.camera.capture()
    except WrongImage as error:
        raise SkillFailed("wrong_image", str(error)) from error
    request = cell.detectors[detector or next(iter(cell.detectors))].request(frame, view)
    # The detector searches the frame during these checks.
    for reason, fault in cell.camera.find_faults(frame, cell.clock.now).items():
        raise SkillFailed(reason, fault)
    # Both checks together exceed a control period.
    if not request.ready:
        yield
    cell.ledger.observe_bins(cell.camera.inspect_bins(frame), frame)
    while not request.ready:
        yield
    try:
        answer = request.result()
    except Unavailable as error:
        reason = "crowded" if isinstance(error, Crowded) else "unavailable"
        raise SkillFailed(reason, str(error)) from error
    return Detections(**vars(answer), frame=frame, view=view, area=cell.camera.get_view_box(view))


def localize_and_observe(
    cell: Cell, look: Detections
) -> Generator[None, None, tuple[Sequence[Observation], list[Target]]]:
    """Localize the detections of a look, update the ledger, and return the observations and all targets.

    Localization, update and what follows run in separate control steps, because their total computation time
    exceeds a control period.

    Raises:
        SkillFailed: `no_depth`, or `stale` if the robot may have moved objects since the capture.
    """
    try:
        observations = cell.localizer.localize(look)
    except NoDepth as error:
        raise SkillFailed("no_depth", str(error)) from error
    yield
    if not cell.ledger.is_current(look.frame):
        message = f"the robot may have moved objects after frame {look.frame.id} was captured; look again"
        raise SkillFailed("stale", message)
    targets = list(cell.ledger.observe(look, observations))
    yield
    if look.view == "full":
        items = [target for target in cell.ledger.find_objects_on_table() if target.label]
        known_objects = [make_obstacle(cell, target) for target in items]
        cell.ledger.observe_regions(look, cell.camera.find_unexplained(look, known_objects))
        yield
    return observations, targets


def complete(loop: Generator[None, None, T], advance: Callable[[], None] = lambda: None) -> T:
    """Execute a loop outside a skill, or within one control step; `advance` is called after each `yield`."""
    while True:
        try:
            next(loop)
        except StopIteration as end:
            result: T = end.value
            return result
        advance()


def wait_for_rest(arm: Arm) -> Steps:
    """Yield until the arm is at rest; an earlier skill may have left the arm braking."""
    while not arm.at_rest:
        yield


def plan(
    skill: Skill, arm: Arm, find_goal_and_task: Callable[[], tuple[Goal | str, Task]]
) -> Generator[None, None, Motion]:
    """Yield until the arm is at rest and has planned a motion, and return the motion.

    If an update of the ledger changes goal or task during the planning, the arm plans again.

    Args:
        skill: The skill that moves the arm.
        arm: The arm.
        find_goal_and_task: Function that returns the current goal (or the name of a pose) and task, or raises
            Blocked.

    Raises:
        SkillFailed: No motion was found; the reason is `unreachable` or `blocked`.
    """
    yield  # The first control step of a skill already has a high computational load.
    yield from wait_for_rest(arm)
    try:
        for _ in range(MAX_PLANNING_ATTEMPTS):
            goal, task = find_goal_and_task()
            planning = arm.plan(goal, task)
            while not planning.ready:
                yield
            if find_goal_and_task() == (goal, task):
                break
        return planning.result()
    except (Unreachable, Blocked) as error:
        reason = "blocked" if isinstance(error, Blocked) else "unreachable"
        raise skill.failure(reason, str(error)) from error


def follow(
    skill: Skill,
    cell: Cell,
    motion: Motion,
    guard: MotionGuard = MotionGuard(),
    until: Callable[[], bool] = lambda: False,
) -> Steps:
    """Yield while the arm executes `motion`, until the arm is at rest again.

    The arm brakes along the path at an event of `guard`, if `until` returns True, after a collision, and if
    the skill is halted. The arm itself watches for the events of `guard`, at its own rate.

    Raises:
        SkillFailed: The arm collided with an obstacle; the reason is `blocked`.
    """
    arm = cell.arm
    arm.start(motion, guard)
    try:
        while not arm.at_rest and not until():
            yield
    finally:
        arm.stop()
    yield from wait_for_rest(arm)
    if arm.collision is not None:
        cell.ledger.record_collision(arm.contact_point)
        raise skill.failure("blocked", arm.collision)


def move_to_pose(skill: Skill, cell: Cell, select_pose: Callable[[], str | None]) -> Steps:
    """Yield until the arm has moved to a named pose; `select_pose` returns it, or None to stay.

    `select_pose` is called when the arm is at rest.

    Raises:
        SkillFailed: No motion was found, or the arm collided; the reason is `unreachable` or `blocked`.
    """
    yield from wait_for_rest(cell.arm)
    if (pose := select_pose()) is not None:
        motion = yield from plan(skill, cell.arm, lambda: (pose, make_task(cell)))
        yield from follow(skill, cell, motion)


def transport(skill: Skill, cell: Cell, item: Item, goal: Goal, goal_name: str) -> Steps:
    """Yield until the arm has moved `item` to `goal`; read the sensor of the tool in every control step.

    A contact of the item ends a guarded descent. `goal_name` is the name of the goal in error messages.

    Raises:
        SkillFailed: No motion was found, or the arm collided; the reason is `unreachable` or `blocked`.
        SkillFailed: The tool lost the item; the reason is `dropped`. The arm rests, and the tool is open.
    """
    try:
        motion = yield from plan(skill, cell.arm, lambda: (goal, make_transport_task(cell, item)))
        guard = MotionGuard(touch=goal.guarded_length > 0, lost_grip=True)
        yield from follow(skill, cell, motion, guard, until=lambda: detect_and_record_drop(cell, item))
    except SkillFailed:
        # `dropped` has priority: handlers of the other reasons expect the item in the tool.
        if not detect_and_record_drop(cell, item):
            raise
    fail_if_dropped(skill, cell, item, f"on the way to {goal_name}")


def release(
    skill: Skill, cell: Cell, item: Item, settle: float, record_release: Callable[[], None], *, falls: bool
) -> Steps:
    """Open the tool, and yield for `settle` [s] until the item lies still.

    The load of the tool shows an item that still hangs on the tool, too.

    `record_release` records the new position of the item in the ledger, even if the skill is halted
    during the wait, provided that the tool is empty. `falls` is True if the item falls away from the tool,
    so that a tool that still touches something shows an item that sticks to it.

    Raises:
        SkillFailed: The item still hangs on the tool; the reason is `stuck`.
    """
    cell.tool.open()
    is_stuck = False
    try:
        yield from cell.clock.sleep(settle)
        yield from wait_for_fingers(cell)
        is_stuck = cell.tool.holding or (falls and (cell.tool.touching or is_loaded(cell, item) is True))
    finally:
        if not (is_stuck or cell.tool.holding):
            record_release()
    if is_stuck:
        raise skill.failure("stuck", f"{item} hangs on the tool {settle:.2f} s after release")
    # The ledger compares the zero with that before the approach.
    cell.ledger.record_empty_load(cell.tool.load)


def wait_for_fingers(cell: Cell) -> Steps:
    """Yield until the distance between the fingers stays the same; end at once for a tool without fingers."""
    if not cell.tool_model.max_opening:
        return
    previous_opening = math.inf
    for _ in range(MAX_FINGER_CHECK_COUNT):
        opening = cell.tool.opening
        if abs(opening - previous_opening) <= MAX_OPENING_CHANGE:
            return
        previous_opening = opening
        yield from cell.clock.sleep(FINGER_CHECK_TIME)


def is_loaded(cell: Cell, item: Item) -> bool | None:
    """Return True if the load of the tool at rest is at least half of the weight of `item`.

    None: the load is no evidence, because the item is too light for the noise of one reading, or because the
    load cell is broken: the reading is exactly the load of the empty tool, or no finite number.
    """
    weight = cell.get_weight(cell.ledger.get_label(item))
    # Both the load and the load of the empty tool contain the noise of one reading.
    if weight / 2 < MIN_LOAD_DEVIATIONS * math.sqrt(2) * cell.tool.load_std:
        return None
    load = cell.tool.load
    is_constant = load == cell.ledger.empty_load and cell.tool.load == load
    if is_constant or not math.isfinite(load):
        return None
    return load - cell.ledger.empty_load >= weight / 2


def verify_grasp(skill: Skill, cell: Cell, item: Item, goal: Goal) -> Steps:
    """Compare the sensor of the grip with the load of the tool at rest, and update the ledger.

    A transport that ended before its goal, at which the sensor reports an object, lost the item on the way.

    One reading suffices if it agrees. Otherwise, `LOAD_CHECK_TIME` later, the second reading decides.

    Raises:
        SkillFailed: The tool holds nothing, or something much lighter than `item`; the tool is then open.
            The reason is `dropped`, or `sensor_implausible` if the sensor reports an object in free air.
    """
    has_arrived = math.dist(cell.arm.tool_pose.position, goal.position) <= MAX_ARRIVAL_ERROR
    if has_arrived and is_loaded(cell, item) is False:
        yield from cell.clock.sleep(LOAD_CHECK_TIME)
        fail_if_dropped(skill, cell, item, "at the end of the transit")
    is_held = is_loaded(cell, item)
    if has_arrived and is_held is not False:
        if is_held:
            cell.ledger.record_held_load()
        return
    noun = cell.tool_model.noun
    cell.tool.open()
    cell.ledger.record_false_grasp(item)
    try:
        cell.tool.close()
        yield from cell.clock.sleep(LOAD_CHECK_TIME)
        is_implausible = cell.tool.holding and not cell.tool.touching
    finally:
        cell.tool.open()
    if is_implausible:
        message = f"the sensor reports a {noun} in free air; repair the sensor of the tool"
        raise skill.failure("sensor_implausible", message)
    raise skill.failure(
        "dropped", f"the sensor reports a {noun} on {item}, but load or motion show no {item}"
    )


def make_task(cell: Cell) -> Task:
    """Return the task of a motion: all obstacles, and the item in the tool as the load."""
    held_item = cell.ledger.find_held_item()
    if held_item is not None:
        return make_transport_task(cell, held_item)
    # The opening is rounded up, so that its noise does not change the task.
    opening = math.ceil(cell.tool.opening * 1000) / 1000 if cell.tool_model.max_opening else 0.0
    return Task(obstacles=list_obstacles(cell), opening=opening)


def make_transport_task(cell: Cell, item: Item) -> Task:
    """Return the task of a motion with `item` as the load, and with all other objects as obstacles."""
    object_class = cell.classes[cell.ledger.get_label(item)]
    force = cell.tool_model.compute_holding_force(object_class, cell.tool.holding_force)
    opening = cell.tool_model.compute_grip_opening(object_class)
    return Task(object_class, force, list_obstacles(cell, item), opening=opening)


MAX_PREDICTABLE_SPEED = 0.2
"""Maximum tool speed at which the landing position of an item is predictable [m/s]; faster items roll."""


def fail_if_dropped(skill: Skill, cell: Cell, item: Item, place: str) -> None:
    """If the tool has lost `item`, record the drop, open the tool, and fail.

    `place` describes the place of the drop in the error message.

    Raises:
        SkillFailed: The tool lost the item; the reason is `dropped`.
    """
    if detect_and_record_drop(cell, item):
        x, y, z = cell.arm.tool_pose.position
        cell.tool.open()
        noun = cell.tool_model.noun
        message = f"the {noun} on {item} broke {place}, near ({x:.2f}, {y:.2f}, {z:.2f}) m"
        raise skill.failure("dropped", message)


def detect_and_record_drop(cell: Cell, item: Item) -> bool:
    """Return True if the tool has dropped the item; the first call after the drop updates the ledger.

    A transport calls this function in every control step, so that the ledger knows the drop before a camera
    shows the item at another place.
    """
    if cell.tool.holding:
        return False
    if cell.ledger.find_held_item() == item:
        velocity = cell.arm.tool_velocity
        is_predictable = float(np.linalg.norm(velocity)) <= MAX_PREDICTABLE_SPEED
        landing = None
        if is_predictable:
            object_class = cell.classes[cell.ledger.get_label(item)]
            # Each read of the tool pose is written to the journal, so it is read only if it is needed.
            underside = cell.arm.tool_pose.position.copy()
            underside[2] -= cell.tool_model.get_hold_height(object_class)
            landing = predict_landing(underside, velocity, object_class.height)
        cell.ledger.record_drop(item, landing)
    return True


def predict_landing(position: Array, velocity: Array, height: float) -> Array:
    """Return the centre of a dropped object `(3,)` [m] after a ballistic fall without rolling.

    Args:
        position: Centre of the underside of the object at the drop `(3,)` [m].
        velocity: Velocity of the tool at the drop `(3,)` [m/s].
        height: Height of the object [m].
    """
    vertical_speed = float(velocity[2])
    fall_height = max(float(position[2]), 0.0)
    # Ballistic fall: positive solution t of fall_height + vertical_speed * t - GRAVITY / 2 * t**2 = 0.
    fall_time = (vertical_speed + math.sqrt(vertical_speed**2 + 2 * GRAVITY * fall_height)) / GRAVITY
    x, y = (position + velocity * fall_time)[:2]
    return np.array((x, y, height / 2))
