"""How skills use the arm: one user after another, one safe way across the cell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from executive.cell import Arm, Cell, Motion, Steps, Via
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.skill import Skill


def settle(arm: Arm) -> Steps:
    """Yield until the arm is at rest: whoever uses it next waits for the braking of whoever used it last."""
    while not arm.at_rest:
        yield


def follow(arm: Arm, motion: Motion, until: Callable[[], bool] = lambda: False) -> Steps:
    """Yield while the arm follows `motion`, until it is at rest again.

    The arm brakes along its path as soon as `until` holds, and on any early end of the skill.
    """
    yield from settle(arm)
    arm.start(motion)
    try:
        while not arm.at_rest and not until():
            yield
    finally:
        arm.stop()
    yield from settle(arm)


def planned(skill: Skill, plan: Callable[[], Motion]) -> Motion:
    """Return the motion that `plan` returns.

    Raises:
        SkillFailed: There is none; the reason is the skill's `unreachable` or `blocked`.
    """
    try:
        return plan()
    except Unreachable as error:
        raise skill.failed("unreachable", str(error)) from error
    except Blocked as error:
        raise skill.failed("blocked", str(error)) from error


def travel(cell: Cell, over: Array) -> list[Via]:
    """Return the way from where the tool is to a place: straight up, across at travel height.

    Args:
        cell: The work cell.
        over: Point `(2,)` or `(3,)` [m] above which the tool is to arrive; its height is not used.
    """
    here = cell.arm.tool_pose.position
    vias = []
    if here[2] < cell.travel_height - 1e-3:
        vias.append(Via(np.array([here[0], here[1], cell.travel_height])))
    vias.append(Via(np.array([over[0], over[1], cell.travel_height])))
    return vias
