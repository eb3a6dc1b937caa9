"""How skills use the arm: one user after another, each motion planned, checked and watched."""

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
"""Times that a motion is planned when what stands around changes meanwhile."""


def wait_for_rest(arm: Arm) -> Steps:
    """Yield until the arm is at rest: whoever uses it next waits for the braking of whoever used it last."""
    while not arm.at_rest:
        yield


def plan(skill: Skill, arm: Arm, ask: Callable[[], tuple[Goal | str, Task]]) -> Generator[None, None, Motion]:
    """Yield until the arm rests and the motion that `ask` wants is planned, and return it.

    What is wanted is asked once more when the plan is there: if a look has shown something new meanwhile, it
    is planned anew, a few times at most.

    Raises:
        SkillFailed: There is none; the reason is the skill's `unreachable` or `blocked`.
    """
    yield from wait_for_rest(arm)
    for _ in range(MAX_PLANS):
        goal, task = ask()
        planning = arm.plan(goal, task)
        while not planning.ready:
            yield
        if ask() == (goal, task):
            break
    try:
        return planning.result()
    except Unreachable as error:
        raise skill.failed("unreachable", str(error)) from error
    except Blocked as error:
        raise skill.failed("blocked", str(error)) from error


def follow(skill: Skill, cell: Cell, motion: Motion, until: Callable[[], bool] = lambda: False) -> Steps:
    """Yield while the arm follows `motion`, until it is at rest again.

    The arm brakes along its path as soon as `until` holds, when it runs into something, and on any early
    end of the skill.

    Raises:
        SkillFailed: It ran into something; the reason is the skill's `blocked`.
    """
    arm = cell.arm
    arm.start(motion)
    try:
        while not arm.at_rest and not until():
            yield
    finally:
        arm.stop()
    yield from wait_for_rest(arm)
    if arm.met is not None:
        cell.ledger.invalidate_positions()
        raise skill.failed("blocked", arm.met)


def carry(skill: Skill, cell: Cell, item: Item, goal: Goal, whither: str) -> Steps:
    """Yield until `item` has been carried to `goal`, the tool's sensor watched all the way.

    Args:
        skill: Who carries.
        cell: The work cell.
        item: What the tool holds.
        goal: Where to.
        whither: The goal in words, for the text of an error.

    Raises:
        SkillFailed: There is no way, or the arm ran into something, and the tool holds the item still: the
            reason is the skill's `unreachable` or `blocked`. Or the seal broke, for whatever cause: then the
            arm is at rest, the tool open, the ledger told, and the reason is the skill's `dropped`.
    """
    try:
        motion = yield from plan(skill, cell.arm, lambda: (goal, task_of_carrying(cell, item)))
        yield from follow(skill, cell, motion, until=lambda: record_drop(cell, item))
    except SkillFailed:
        # Whatever else went wrong: what the tool no longer holds cannot be put down.
        if not record_drop(cell, item):
            raise
    if record_drop(cell, item):
        x, y, z = cell.arm.tool_pose.position
        cell.tool.open()
        raise skill.failed(
            "dropped", f"the seal on {item} broke on the way to {whither}, near ({x:.2f}, {y:.2f}, {z:.2f}) m"
        )


def let_go(skill: Skill, cell: Cell, item: Item, wait: float, told: Callable[[], None]) -> Steps:
    """Switch the vacuum off and yield for `wait` [s]; afterwards the tool's sensor says that it is empty.

    The ledger is `told` where the item went as soon as the tool is empty, also when the skill is taken away
    meanwhile: what has fallen cannot be kept in the books as held.

    Raises:
        SkillFailed: `item` still hangs on the tool; the reason is the skill's `stuck`.
    """
    cell.tool.open()
    try:
        yield from cell.clock.sleep(wait)
    finally:
        if not cell.tool.holding:
            told()
    if cell.tool.holding:
        raise skill.failed("stuck", f"{item} hangs on the tool {wait:.2f} s after release")


def task_of_moving(cell: Cell) -> Task:
    """Return the task of going somewhere with whatever the tool holds."""
    held = cell.ledger.find_held_item()
    return Task(around=list_obstacles(cell)) if held is None else task_of_carrying(cell, held)


def task_of_carrying(cell: Cell, item: Item) -> Task:
    """Return the task of carrying `item`, which the tool holds."""
    kind = cell.classes[cell.ledger.get_label(item)]
    return Task(Load(kind, cell.tool.bears), list_obstacles(cell, item))
