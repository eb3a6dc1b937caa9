"""Log with the last state of a fake world, from which the world of an interrupted run is restored."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from executive.cells.fake.arm import FakeArm
from executive.cells.fake.world import FakeObject, FakeWorld
from executive.cells.log_file import LogFile
from executive.errors import InputError
from executive.geometry import Array, Pose


class FakeLog(LogFile):
    """A file with the last state of a fake world, rewritten after every control step."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "the state of the world")
        self._length = 0

    def write_state(self, steps: int, last_command: int, world: FakeWorld, arm: FakeArm) -> None:
        """Replace the content of the file by the state after `steps` control steps; ignored if closed.

        Raises:
            Fault: The disk does not accept the state.
        """
        if not self.is_open:
            return
        state = {
            "steps": steps,
            "last_command": last_command,
            "objects": list(map(_to_json, world.objects)),
            "removed": list(map(_to_json, world.removed_objects)),
            "held": next((n for n, obj in enumerate(world.objects) if obj is world.held), None),
            "tool": [arm.tool_pose.rotation, arm.tool_pose.position],
        }
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # No write is shorter than an earlier one, so that the file contains one state, followed by blanks.
        self._length = max(self._length, len(text))
        self.write(text.ljust(self._length), 0)


def restore_world(path: Path, world: FakeWorld, arm: FakeArm) -> tuple[int, int]:
    """Restore world and arm to the state in a log, with the arm at rest.

    Returns:
        Number of control steps, and control step of the last command to arm or tool.

    Raises:
        InputError: The log contains no state.
    """
    try:
        state: Mapping[str, Any] = json.loads(path.read_bytes())
        world.objects[:] = [_read_object(**fields) for fields in state["objects"]]
        world.removed_objects[:] = [_read_object(**fields) for fields in state["removed"]]
        world.held = None if state["held"] is None else world.objects[state["held"]]
        rotation, position = map(_read_array, state["tool"])
        arm.set_tool_pose(Pose(rotation.reshape(3, 3), position.reshape(3)))
        return int(state["steps"]), int(state["last_command"])
    except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
        raise InputError(
            f'the world cannot be rebuilt from "{path}": {error}; run the mission again from its start'
        ) from error


def _to_json(written: FakeObject) -> Mapping[str, Any]:
    """Return an object with the keys of the log, which are the arguments of `_read_object`."""
    state = {"label": written.label, "position": written.position}
    return {**state, "stood": written.rest_positions, "fell": written.is_dropped}


def _read_array(value: object) -> Array:
    return np.array(value, dtype=np.float64)


def _read_object(label: str, position: object, stood: Sequence[object], fell: bool) -> FakeObject:
    rest_positions = [_read_array(place).reshape(3) for place in stood]
    return FakeObject(str(label), _read_array(position).reshape(3), rest_positions, bool(fell))
