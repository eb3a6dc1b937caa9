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
from executive.geometry import Pose


class FakeStateLog(LogFile):
    """A file with the last state of a fake world, rewritten after every control step."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "the state of the world")
        self._length = 0

    def write_state(self, steps: int, last_command_step: int, world: FakeWorld, arm: FakeArm) -> None:
        """Replace the content of the file by the state after `steps` control steps.

        Raises:
            Fault: The disk does not accept the state.
        """
        state = {
            "steps": steps,
            "last_command": last_command_step,
            "objects": list(map(vars, world.objects)),
            "removed": list(map(vars, world.removed_objects)),
            "held": None if world.held_object is None else world.objects.index(world.held_object),
            "tool": [arm.tool_pose.rotation, arm.tool_pose.position],
        }
        text = json.dumps(state, default=np.ndarray.tolist).encode()
        # Blanks pad the text to the length of the longest state so far, to overwrite all old text.
        self._length = max(self._length, len(text))
        self.write(text.ljust(self._length), 0)


def restore_world(path: Path, world: FakeWorld, arm: FakeArm) -> tuple[int, int]:
    """Restore world and arm to the state in a log, with the arm at rest.

    Returns:
        Number of control steps, and control step of the last command to arm or tool.

    Raises:
        InputError: The log cannot be read, or contains no valid state.
    """
    try:
        state: Mapping[str, Any] = json.loads(path.read_bytes())
        world.objects[:] = [_read_object(**fields) for fields in state["objects"]]
        world.removed_objects[:] = [_read_object(**fields) for fields in state["removed"]]
        world.held_object = None if state["held"] is None else world.objects[state["held"]]
        rotation, position = (np.array(value, dtype=float) for value in state["tool"])
        arm.set_tool_pose(Pose(rotation.reshape(3, 3), position.reshape(3)))
        return int(state["steps"]), int(state["last_command"])
    except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
        problem = f'the world cannot be rebuilt from "{path}": {error}'
        raise InputError(f"{problem}; run the mission again from its start") from error


def _read_object(
    label: str, position: object, rest_positions: Sequence[object], is_dropped: bool
) -> FakeObject:
    """Return an object from its attributes in the log."""
    current, *others = np.array([position, *rest_positions], dtype=float).reshape(-1, 3)
    return FakeObject(str(label), current, others, bool(is_dropped))
