"""How skills use the arm: one user after another, each motion planned, checked and watched."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator

from executive.arm import Arm, Goal, Motion, Task
from executive.cell import Cell, Steps
from executive.errors import Blocked, Unreachable
from executive.messages import BIN_THICKNESS, Item, Load, Obstacle, Target
from executive.skill import Skill

PLANS = 3
"""Times that a motion is planned when what stands around changes meanwhile."""
ROLLED = 0.002
"""How far an object in a bin may lie from where it was let go [m]."""
DROP = 0.01
"""Height above the floor at which the underside of an item is let go, unless a mission says otherwise [m]."""
OVERTRAVEL = 0.015
"""How far below the expected surface an approach feels, unless a mission says otherwise [m]."""
SPACING = 0.0025
"""Spacing of the spiral on which further attempts come down, unless a mission says otherwise [m]."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


def settle(arm: Arm) -> Steps:
    """Yield until the arm is at rest: whoever uses it next waits for the braking of whoever used it last."""
    while not arm.at_rest:
        yield


def planned(
    skill: Skill, arm: Arm, ask: Callable[[], tuple[Goal | str, Task]]
) -> Generator[None, None, Motion]:
    """Yield until the arm rests and the motion that `ask` wants is planned, and return it.

    What is wanted is asked once more when the plan is there: if a look has shown something new meanwhile, it
    is planned anew, a few times at most.

    Raises:
        SkillFailed: There is none; the reason is the skill's `unreachable` or `blocked`.
    """
    yield from settle(arm)
    for _ in range(PLANS):
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
    yield from settle(arm)
    if arm.met is not None:
        cell.ledger.bumped()
        raise skill.failed("blocked", arm.met)


def around(cell: Cell, but: Item | None = None) -> tuple[Obstacle, ...]:
    """Return what stands in the cell beyond what its file says, the item `but` left out.

    That is what the ledger believes on the table, and what lies in the bins (`slots_taken`).
    """
    return (
        *(_standing(cell, target) for target in cell.ledger.standing() if target.item != but),
        *_filled(cell, but),
    )


def slots_taken(cell: Cell, bin: str, but: Item | None = None) -> int:
    """Return how many objects lie in `bin`, the item `but` not counted: the number of its next free slot.

    What the tool carries into the bin counts, so that a plan made meanwhile still holds when it was let go.
    """
    held = cell.ledger.in_tool()
    coming = held not in (None, but) and cell.bins[bin].contains(cell.arm.destination)
    return cell.ledger.objects_in(bin) + coming


def heeding(cell: Cell) -> Task:
    """Return the task of going somewhere with whatever the tool holds."""
    held = cell.ledger.in_tool()
    return Task(around=around(cell)) if held is None else carrying(cell, held)


def carrying(cell: Cell, item: Item) -> Task:
    """Return the task of carrying `item`, which the tool holds."""
    kind = cell.classes[cell.ledger.label(item)]
    return Task(Load(kind, cell.tool.bears), around(cell, item))


def approach(
    cell: Cell,
    target: Target,
    overtravel: float = OVERTRAVEL,
    spacing: float = SPACING,
) -> tuple[Goal, Task]:
    """Return goal and task of an approach: through the surface of `target`, felt for on the last part.

    Every attempt after a failed one comes down a little beside the last.

    Args:
        cell: The work cell.
        target: What to touch.
        overtravel: How far below the expected surface to feel [m], but not below the target's middle: what
            is felt there is the table.
        spacing: Of the spiral of further attempts [m].
    """
    kind = cell.classes[target.label]
    x, y, middle = (float(value) for value in target.position)
    dx, dy = _aside(cell.ledger.attempts(target.item), kind.ring, spacing)
    surface = middle + kind.height / 2
    lowest = max(surface - overtravel, middle)
    guarded = surface + cell.descent - lowest
    goal = Goal((x + dx, y + dy, lowest), guarded=guarded, speed=cell.descent_speed)
    return goal, Task(around=around(cell, target.item), target=_standing(cell, target))


def into(cell: Cell, bin: str, item: Item, drop: float = DROP) -> Goal:
    """Return the goal of a transit: over the next free slot of a bin, `drop` [m] above what is there."""
    box, height = cell.bins[bin], cell.classes[cell.ledger.label(item)].height
    layer, place = divmod(slots_taken(cell, bin, item), len(box.slots))
    x, y = (float(value) for value in box.slots[place])
    return Goal((x, y, _layer(cell, bin, layer) + height + drop))


def _layer(cell: Cell, bin: str, layer: int) -> float:
    """Return the height on which a layer of objects in a bin lies at most [m]; layer 0 is on the floor."""
    tallest = max(kind.height for kind in cell.classes.values())
    return float(cell.bins[bin].position[2]) + BIN_THICKNESS + layer * tallest


def _aside(attempt: int, ring: float, spacing: float) -> tuple[float, float]:
    """Return the sideways step (x, y) [m] of an attempt: a point of the ring, or of Vogel's spiral.

    The turn of a part is not known, and any point of its ring is as good as another. The spiral begins in
    the middle.
    """
    angle = attempt * GOLDEN_ANGLE
    distance = ring or spacing * math.sqrt(attempt)
    return distance * math.cos(angle), distance * math.sin(angle)


def _standing(cell: Cell, target: Target) -> Obstacle:
    x, y, middle = (float(value) for value in target.position)
    kind = cell.classes[target.label]
    return Obstacle(x, y, kind.radius, middle + kind.height / 2, target.item)


def _filled(cell: Cell, but: Item | None) -> Iterator[Obstacle]:
    """Yield what stands on the slots of bins that were used, the item `but` left out."""
    widest = max(kind.radius for kind in cell.classes.values())
    for name, box in cell.bins.items():
        count, slots = slots_taken(cell, name, but), len(box.slots)
        for number, (x, y) in enumerate(box.slots[:count]):
            top = _layer(cell, name, (count - 1 - number) // slots + 1)
            yield Obstacle(
                float(x), float(y), widest + ROLLED, top, f"what lies in slot {number + 1} of {name}"
            )
