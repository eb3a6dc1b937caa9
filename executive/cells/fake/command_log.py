"""Last state of a fake world, from which it can be rebuilt: it has no physics that must be repeated."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from executive.cells.fake.arm import FakeArm
from executive.cells.fake.world import FakeObject, FakeWorld
from executive.cells.log_file import LogFile
from executive.errors import InputError
from executive.geometry import Pose


class FakeLog(LogFile):
    """Keeps the last state of a fake world in a file, written whole after every control step."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "the state of the world")
        self._length = 0

    def keep(self, steps: int, world: FakeWorld, arm: FakeArm) -> None:
        """Write the present state, after a number of control steps.

        Raises:
            Fault: The disk does not accept the state.
        """
        if not self.is_open:
            return
        state = {
            "steps": steps,
            "objects": [vars(thing) for thing in world.objects],
            "removed": [vars(thing) for thing in world.removed],
            "held": next((n for n, thing in enumerate(world.objects) if thing is world.held), None),
            "tool": [arm.tool_pose.rotation, arm.tool_pose.position],
        }
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # In one go, and never shorter than before: a reader finds one state, followed by blanks.
        self._length = max(self._length, len(text))
        self.write(text.ljust(self._length), 0)


def restore(path: Path, world: FakeWorld, arm: FakeArm) -> int:
    """Bring world and arm into the state in a log, the arm at rest, and return the number of control steps.

    Raises:
        InputError: The log contains no state.
    """
    try:
        state: Mapping[str, Any] = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(
            f'the world cannot be rebuilt from "{path}": {error}; run the mission again from its start'
        ) from error
    world.objects[:] = [_read_object(**one) for one in state["objects"]]
    world.removed[:] = [_read_object(**one) for one in state["removed"]]
    world.held = None if state["held"] is None else world.objects[state["held"]]
    arm.put(Pose(*map(np.array, state["tool"])))
    return int(state["steps"])


def _read_object(label: str, position: list[float], stood: list[list[float]], fell: bool) -> FakeObject:
    return FakeObject(label, np.array(position), [np.array(place) for place in stood], fell)
