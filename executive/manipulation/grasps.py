"""Choice of a grasp, and of yaws at which the fingers of a tool stay clear of objects and bin walls."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.objects import Bin, Item, Obstacle, Target
from executive.cell.protocols import Cell
from executive.cell.tools import (
    CONTACT_SPACING,
    OVERTRAVEL,
    GraspAttempt,
    GraspPose,
    ToolModel,
    ToolPart,
)
from executive.errors import Blocked, Fault
from executive.geometry import Array, HeldPose, Yaw, compute_tool_yaw, make_tool_down_pose
from executive.manipulation.tool_goals import (
    DROP_HEIGHT,
    find_layer_thickness,
    list_obstacles,
    make_obstacle,
    make_slot_goal,
    predict_next_slot_index,
)

YAW_COUNT = 24
"""Number of yaws that are tried if every yaw is permitted."""
POINT_SPACING = 0.004
"""Maximum distance between the points that represent the base of a part of the tool [m]."""
MAX_IGNORED_OFFSET = 0.001
"""Maximum distance between the tool and the middle of an object that is not corrected [m], so that the
planner may choose among the equal yaws of a symmetrical object."""
SAFETY_DISTANCE = 0.001
"""Distance in addition to the margin of the cell file [m], so that the planner does not need the last
millimetre."""


def choose_grasp(
    cell: Cell, target: Target, overtravel: float = OVERTRAVEL, spacing: float = CONTACT_SPACING
) -> tuple[GraspPose, Task]:
    """Return the best grasp of a target, and the task of the approach; each attempt has another grasp.

    Args:
        cell: The work cell.
        target: Target to grasp.
        overtravel: As in `GraspAttempt` [m].
        spacing: As in `GraspAttempt` [m].

    Raises:
        Blocked: The fingers would hit a neighbour or a wall at every grasp; the message names it.
    """
    attempt = GraspAttempt(
        cell.ledger.describe(target.item).attempts,
        cell.ledger.is_confirmed_by_tool(target.label),
        overtravel,
        spacing,
    )
    object_class = cell.classes[target.label]
    grasps = cell.tool_model.list_grasps(object_class, target, cell.motion, attempt)
    if not grasps:
        raise Fault(f'the tool "{cell.tool_model.kind}" lists no grasp of a {target.label}')
    obstacles = list_obstacles(cell, target.item)
    bins = cell.bins.values()
    margin = cell.motion.margin
    blocker = ""
    for grasp in grasps:
        yaws, name = find_free_yaws(cell.tool_model, grasp.opening, grasp.goal, obstacles, bins, margin)
        blocker = blocker or name
        if not name:
            obstacle = make_obstacle(cell, target)
            if grasp.guard == "touch" and object_class.grasp_points:
                # The tool may be lower than parts of the object that are higher than the grasp point.
                depth = object_class.height - object_class.hold_height
                obstacle = replace(obstacle, top=obstacle.top - depth)
            task = Task(obstacles=obstacles, target=obstacle, opening=grasp.opening)
            return replace(grasp, goal=replace(grasp.goal, yaws=yaws)), task
    raise Blocked(f"the open fingers have no space beside {target.item}: {blocker} is in the way")


def explain_blocked_grasp(cell: Cell, target: Target) -> str:
    """Return the sentence that names a neighbour or a wall if they block every grasp of a target, else ""."""
    if cell.tool_model.max_opening:
        try:
            choose_grasp(cell, target)
        except Blocked as error:
            return str(error)
    return ""


def measure_held_pose(cell: Cell, target: Target) -> HeldPose | None:
    """Return the place of a target relative to the tool that grips it.

    The result is None if no bin needs it, or if the yaw of the target is unknown.
    """
    # The border records each read of the tool pose, so it is read only if a bin needs it.
    if target.yaw is None or not any(bin.place_yaws for bin in cell.bins.values()):
        return None
    X_WT = cell.arm.tool_pose
    held_yaw = cell.tool_model.compute_held_yaw(
        cell.classes[target.label], target.yaw, compute_tool_yaw(X_WT)
    )
    x, y, _ = X_WT.inverse().apply(target.position).round(4).tolist()
    # The fingers move the object between them to the middle. The goal remains that of the plan ahead although
    # the arm trembles.
    offset = (x, 0.0 if cell.tool_model.max_opening else y)
    return HeldPose(held_yaw._replace(angle=round(held_yaw.angle, 3)), offset)


def make_bin_goal(
    cell: Cell, bin_name: str, item: Item, held: HeldPose | None, drop_height: float = DROP_HEIGHT
) -> Goal:
    """Return the tool goal at which `item` is `drop_height` [m] above the next slot of a bin.

    Fingers that open there do not hit walls or objects, if there is such a yaw. `held` is the place of the
    item relative to the tool. If the bin needs a yaw, the middle of the item is above that of the slot.

    Raises:
        Blocked: The bin needs the yaw of the item, which is unknown or at which the fingers would hit
            something; the message names it.
    """
    object_class = cell.classes[cell.ledger.get_label(item)]
    slot_index = predict_next_slot_index(cell, bin_name, item)
    hold_height = cell.tool_model.get_hold_height(object_class)
    thickness = find_layer_thickness(cell, bin_name)
    goal = make_slot_goal(cell.bins[bin_name], slot_index, hold_height, thickness, drop_height)
    yaws = _list_place_yaws(cell, bin_name, item, held.yaw if held else None)
    if yaws and held and math.hypot(*held.offset) > MAX_IGNORED_OFFSET:
        yaws = yaws[:1]
        shift = make_tool_down_pose(goal.position, yaws[0]).rotation @ [*held.offset, 0.0]
        x, y, z = (np.array(goal.position) - shift * [1, 1, 0]).tolist()
        goal = replace(goal, position=(x, y, z))
    opening = cell.tool_model.compute_release_opening(object_class)
    free_yaws, blocker = find_free_yaws(
        cell.tool_model,
        opening,
        replace(goal, yaws=yaws),
        list_obstacles(cell, item),
        cell.bins.values(),
        cell.motion.margin,
    )
    if blocker and yaws:
        raise Blocked(f"the fingers cannot open at the yaw that {bin_name} needs: {blocker} is in the way")
    return replace(goal, yaws=free_yaws)


def _list_place_yaws(cell: Cell, bin_name: str, item: Item, held_yaw: Yaw | None) -> tuple[float, ...]:
    """Return the yaws of the tool [rad] at which `item` has the yaw of the next slot; () for every yaw."""
    place_yaws = cell.bins[bin_name].place_yaws
    object_class = cell.classes[cell.ledger.get_label(item)]
    symmetry = object_class.yaw_symmetry
    if not place_yaws or not symmetry:
        return ()
    place_yaw = place_yaws[predict_next_slot_index(cell, bin_name, item) % len(place_yaws)]
    # The two ends of an object without symmetry may look alike in an image.
    if held_yaw is None or held_yaw.symmetry != symmetry:
        needed = f"{bin_name} needs {item} at {math.degrees(place_yaw):g} degrees"
        raise Blocked(f"{needed}, but no image showed the yaw of {item}; put {item} down and look again")
    direction = object_class.yaw_offset if symmetry <= 2 else 0.0
    first = place_yaw - direction - held_yaw.angle
    return tuple(math.remainder(first + math.tau * index / symmetry, math.tau) for index in range(symmetry))


def find_free_yaws(
    tool: ToolModel,
    opening: float,
    goal: Goal,
    obstacles: Collection[Obstacle],
    bins: Collection[Bin],
    margin: float,
) -> tuple[tuple[float, ...], str]:
    """Return the permitted yaws of a goal [rad] at which the fingers are clear of obstacles and bin walls.

    If no yaw is free, the second value is the name of an obstacle, otherwise "". `opening` is the distance
    between the fingers [m], 0 for a tool without fingers, and `margin` the minimum distance of the fingers
    from obstacles and walls [m].
    """
    if not opening:
        return goal.yaws, ""
    parts = tool.list_parts(opening)
    distance = margin + SAFETY_DISTANCE
    candidates = goal.yaws or tuple(math.tau * index / YAW_COUNT for index in range(YAW_COUNT))
    blockers = [_find_blocker(goal, parts, yaw, obstacles, bins, distance) for yaw in candidates]
    free_yaws = tuple(yaw for yaw, name in zip(candidates, blockers, strict=True) if not name)
    return free_yaws, "" if free_yaws else blockers[0]


def _find_blocker(
    goal: Goal,
    parts: Sequence[ToolPart],
    yaw: float,
    obstacles: Collection[Obstacle],
    bins: Collection[Bin],
    distance: float,
) -> str:
    """Return the name of an obstacle or bin that a part of the tool would hit at the goal, or ""."""
    x, y, z = goal.position
    rotation = make_tool_down_pose(goal.position, yaw).rotation[:2, :2]
    for part in parts:
        bottom = z + part.offset - distance
        points = _list_base_points(part) @ rotation.T + (x, y)
        enlargement = distance if part.sides else distance + part.radius
        for obstacle in obstacles:
            if bottom < obstacle.top:
                distances = np.hypot(*(points - (obstacle.x, obstacle.y)).T)
                if distances.min() < obstacle.radius + enlargement:
                    return obstacle.name
        for bin in bins:
            if bottom < bin.position[2] + bin.size[2]:
                for low, high in bin.walls:
                    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
                    if np.hypot(*outside.T).min() < enlargement:
                        return f"the wall of {bin.name}"
    return ""


def _list_base_points(part: ToolPart) -> Array:
    """Return points `(N, 2)` [m] on the base of a box in the frame of the tool; of a cylinder, the centre."""
    if part.sides is None:
        return np.zeros((1, 2))
    counts = [math.ceil(side / POINT_SPACING) + 1 for side in part.sides]
    ranges = [
        centre + np.linspace(-side / 2, side / 2, count)
        for centre, side, count in zip(part.centre, part.sides, counts, strict=True)
    ]
    return np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 2)
