"""Motions of the arm for skills: plan, follow, carry an item, release an item."""

from __future__ import annotations

from collections.abc import Callable, Generator

from executive.cell.arm import Arm, Goal, Motion, Task
from executive.cell.objects import Item, Load
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked, Unreachable
from executive.manipulation.drops import record_drop
from executive.manipulation.obstacles import list_obstacles
from executive.skill import Skill, SkillFailed

MAX_PLANS = 3
"""Largest number of times that a motion is planned, if the obstacles change during the planning."""


def wait_for_rest(arm: Arm) -> Steps:
    """Yield until the arm is at rest; an earlier skill may have left the arm braking."""
    while not arm.at_rest:
        yield


def plan(
    skill: Skill, arm: Arm, find_goal: Callable[[], tuple[Goal | str, Task]]
) -> Generator[None, None, Motion]:
    """Yield until the arm is at rest and a motion is planned, and return the motion.

    `find_goal` returns the goal or the name of a pose, and the task. If it returns others after the planning,
    because of a new look, the motion is planned again.

    Raises:
        SkillFailed: No motion was found; the reason is `unreachable` or `blocked`.
    """
    yield from wait_for_rest(arm)
    for _ in range(MAX_PLANS):
        goal, task = find_goal()
        planning = arm.plan(goal, task)
        while not planning.ready:
            yield
        if find_goal() == (goal, task):
            break
    try:
        return planning.result()
    except Unreachable as error:
        raise skill.failure("unreachable", str(error)) from error
    except Blocked as error:
        raise skill.failure("blocked", str(error)) from error


def follow(skill: Skill, cell: Cell, motion: Motion, until: Callable[[], bool] = lambda: False) -> Steps:
    """Yield while the arm follows `motion`, until the arm is at rest again.

    The arm brakes along its path as soon as `until` returns True, after a collision, and if the skill is
    halted.

    Raises:
        SkillFailed: The arm collided with something; the reason is `blocked`.
    """
    arm = cell.arm
    arm.start(motion)
    try:
        while not arm.at_rest and not until():
            yield
    finally:
        arm.stop()
    yield from wait_for_rest(arm)
    if arm.collision is not None:
        cell.ledger.invalidate_positions()
        raise skill.failure("blocked", arm.collision)


def carry(skill: Skill, cell: Cell, item: Item, goal: Goal, destination: str) -> Steps:
    """Yield until `item` has been carried to `goal`; the sensor of the tool is read in every control step.

    Args:
        skill: The skill that carries the item.
        cell: The work cell.
        item: Item in the tool.
        goal: Goal of the motion.
        destination: Name of the goal in error messages.

    Raises:
        SkillFailed: No motion was found, or the arm collided, and the tool still holds the item: the reason
            is `unreachable` or `blocked`. Or the seal broke: then the arm is at rest, the tool is open, the
            ledger has recorded the drop, and the reason is `dropped`.
    """
    try:
        motion = yield from plan(skill, cell.arm, lambda: (goal, task_of_carrying(cell, item)))
        yield from follow(skill, cell, motion, until=lambda: record_drop(cell, item))
    except SkillFailed:
        # A lost item outranks the other failure: without the item, a put-down is impossible.
        if not record_drop(cell, item):
            raise
    if record_drop(cell, item):
        x, y, z = cell.arm.tool_pose.position
        cell.tool.open()
        raise skill.failure(
            "dropped",
            f"the seal on {item} broke on the way to {destination}, near ({x:.2f}, {y:.2f}, {z:.2f}) m",
        )


def let_go(skill: Skill, cell: Cell, item: Item, wait: float, record: Callable[[], None]) -> Steps:
    """Switch the vacuum off and yield for `wait` [s]; afterwards the sensor must report an empty tool.

    `record` records the new place of the item in the ledger; it is called if the tool is empty, even if the
    skill is halted during the wait.

    Raises:
        SkillFailed: The item still hangs on the tool; the reason is `stuck`.
    """
    cell.tool.open()
    try:
        yield from cell.clock.sleep(wait)
    finally:
        if not cell.tool.holding:
            record()
    if cell.tool.holding:
        raise skill.failure("stuck", f"{item} hangs on the tool {wait:.2f} s after release")


def task_of_moving(cell: Cell) -> Task:
    """Return the task of a motion with the present content of the tool."""
    held = cell.ledger.find_held_item()
    return Task(around=list_obstacles(cell)) if held is None else task_of_carrying(cell, held)


def task_of_carrying(cell: Cell, item: Item) -> Task:
    """Return the task of a motion with `item` in the tool."""
    kind = cell.classes[cell.ledger.get_label(item)]
    return Task(Load(kind, cell.tool.holding_force), list_obstacles(cell, item))
