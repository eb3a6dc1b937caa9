"""What the arm of a cell file cannot reach, found before anything moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from executive.arm import Goal
from executive.cell_config import CellConfig
from executive.errors import Unreachable
from executive.geometry import Array
from executive.layout import as_bin
from executive.motion.planner import Planner
from executive.workcell import KeyPath


def out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield a key of the cell file and a sentence for every place the tool has to go to and cannot.

    Asked for are every drop slot of every bin and the safe place, from travel height down to where a load is
    let go in one posture, and every named pose within the joint limits.
    """
    planner = Planner(config)
    load = max(kind.height for kind in config.objects.values())

    def problem(place: Array, floor: float) -> str | None:
        try:
            planner.require_reachable(Goal((float(place[0]), float(place[1]), floor + load)))
        except Unreachable as error:
            return str(error)
        return None

    for name, pose in config.arm.poses_deg.items():
        for joint, (angle, limit) in enumerate(
            zip(pose, config.arm.limits.position_deg, strict=True), start=1
        ):
            if abs(angle) > limit:
                yield (
                    ("arm", "poses_deg", name),
                    f'joint {joint} of the pose "{name}" is at {angle:g} degrees; its limit is {limit:g}',
                )
    for name, section in config.bins.items():
        bin = as_bin(name, section)
        for slot in bin.slots:
            sentence = problem(slot, float(bin.position[2]))
            if sentence:
                yield ("bins", name, "position"), f'the bin "{name}" is out of reach: {sentence}'
                break
    sentence = problem(np.array(config.safe_place[:2]), config.safe_place[2])
    if sentence:
        yield ("safe_place",), f"the safe place is out of reach: {sentence}"
