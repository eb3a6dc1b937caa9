"""How skills use the arm: one user after another, each motion planned, checked and watched."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator

from executive.arm import Arm, Goal, Motion, Task
from executive.cell import Cell, Steps
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.messages import BIN_THICKNESS, Bin, Item, Load, ObjectClass, Obstacle, Target
from executive.skill import Skill, SkillFailed

PLANS = 3
"""Times that a motion is planned when what stands around changes meanwhile."""
ROLLED = 0.002
"""How far an object in a bin may lie from where it was let go [m]."""
DROP = 0.01
"""Height of an item's underside above a bin's floor, or the layer of objects there, when it is let go [m].

A mission may say otherwise.
"""
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

    def fell() -> bool:
        if cell.tool.holding:
            return False
        if cell.ledger.in_tool() == item:
            # At once: a look that is taken while the arm still brakes shows it where it lies now.
            cell.ledger.dropped(item)
        return True

    try:
        motion = yield from planned(skill, cell.arm, lambda: (goal, carrying(cell, item)))
        yield from follow(skill, cell, motion, until=fell)
    except SkillFailed:
        # Whatever else went wrong: what the tool no longer holds cannot be put down.
        if not fell():
            raise
    if fell():
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
    goal = onto(
        cell.classes[target.label],
        target.position,
        cell.descent,
        cell.descent_speed,
        attempt=cell.ledger.attempts(target.item),
        overtravel=overtravel,
        spacing=spacing,
    )
    return goal, Task(around=around(cell, target.item), target=_standing(cell, target))


def onto(
    kind: ObjectClass,
    position: Array,
    descent: float,
    descent_speed: float,
    *,
    attempt: int = 0,
    overtravel: float = OVERTRAVEL,
    spacing: float = SPACING,
) -> Goal:
    """Return the goal of an approach to an object.

    Args:
        kind: Its class.
        position: Its centre `(3,)` [m].
        descent: Length of the guarded part above its surface [m].
        descent_speed: Tool speed of that part [m/s].
        attempt: How many have failed before.
        overtravel: See `approach`.
        spacing: See `approach`.
    """
    x, y, middle = (float(value) for value in position)
    dx, dy = _aside(attempt, kind.ring, spacing)
    surface = middle + kind.height / 2
    lowest = max(surface - overtravel, middle)
    return Goal((x + dx, y + dy, lowest), guarded=surface + descent - lowest, speed=descent_speed)


def into(cell: Cell, bin: str, item: Item, drop: float = DROP) -> Goal:
    """Return the goal of a transit: over the next free slot of a bin, `drop` [m] above what is there."""
    height = cell.classes[cell.ledger.label(item)].height
    return over(cell.bins[bin], slots_taken(cell, bin, item), height, _tallest(cell), drop)


def over(bin: Bin, number: int, height: float, tallest: float, drop: float = DROP) -> Goal:
    """Return the goal of a transit over a slot of a bin.

    Args:
        bin: The bin.
        number: Of the slot; from the number of slots on, those of the next layer.
        height: Of what is carried [m].
        tallest: Height of the tallest objects that may lie in a layer below [m].
        drop: Of the underside above that layer, or the floor [m].
    """
    layer, place = divmod(number, len(bin.slots))
    x, y = (float(value) for value in bin.slots[place])
    return Goal((x, y, _level(bin, layer, tallest) + height + drop))


def _tallest(cell: Cell) -> float:
    return max(kind.height for kind in cell.classes.values())


def _level(bin: Bin, layer: int, tallest: float) -> float:
    """Return the height on which a layer of objects in a bin lies at most [m]; layer 0 is on the floor."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * tallest


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
    widest, tallest = max(kind.radius for kind in cell.classes.values()), _tallest(cell)
    for name, box in cell.bins.items():
        count, slots = slots_taken(cell, name, but), len(box.slots)
        for number, (x, y) in enumerate(box.slots[:count]):
            top = _level(box, (count - 1 - number) // slots + 1, tallest)
            yield Obstacle(
                float(x), float(y), widest + ROLLED, top, f"what lies in slot {number + 1} of {name}"
            )
