"""What tests do with a cell by hand before that which they test: look at it, and pick from it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from executive.cell.arm import Goal, Motion, Task
from executive.cell.objects import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize


def look(fake: FakeCell, view: str = "table") -> list[Target]:
    """Look once, and return what was localized."""
    detections = run_skill(Detect(view=view), fake).outputs["detections"]
    return run_skill(Localize(detections=detections), fake).outputs["targets"]


def pick(fake: FakeCell, target: Target) -> str:
    """Grasp an object that was localized; return its item."""
    run_skill(Approach(target=target), fake)
    return run_skill(Grasp(target=target), fake).outputs["held"]


def plan_motion(fake: FakeCell, goal: Goal | str, task: Task = Task()) -> Motion:
    """Return a motion of the arm, once it is planned."""
    planning = fake.cell.arm.plan(goal, task)
    while not planning.ready:
        fake.advance()
    return planning.result()


def intercept(fake: FakeCell, path: str, answer: Callable[..., Any]) -> None:
    """Call `answer` in place of one method of a part of the cell, for instance `camera.sees_table`."""
    fake.border.interceptor = lambda access: (
        answer(*access.arguments) if access.path == path else access.proceed()
    )
