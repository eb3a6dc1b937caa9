"""What is needed to rebuild a fake world as it is: its last state, for it has no physics to repeat."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from executive.cells.fake.arm import FakeArm
from executive.cells.fake.world import FakeObject, FakeWorld
from executive.errors import Fault, InputError, reason_of
from executive.geometry import Pose


class FakeLog:
    """Keeps the last state of a fake world in a file, written whole after every control step.

    Args:
        path: The file.
        world, arm: Their state is kept from now on.

    Raises:
        InputError: The file cannot be written.
    """

    def __init__(self, path: Path, world: FakeWorld, arm: FakeArm) -> None:
        self._path = path
        self._length = 0
        try:
            self._file: int | None = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            self.write(world, arm)
        except OSError as error:
            raise InputError(f'cannot write "{path}": {reason_of(error)}') from error
        except Fault as fault:
            raise InputError(str(fault)) from fault

    def write(self, world: FakeWorld, arm: FakeArm) -> None:
        """Keep the state of this moment.

        Raises:
            Fault: The disk does not take it. Later states are not kept, without another fault, so that the
                arm can be brought to rest.
        """
        if self._file is None:
            return
        held = next((n for n, thing in enumerate(world.objects) if thing is world.held), None)
        state = {
            "steps": world.steps,
            "objects": [_plain(thing) for thing in world.objects],
            "removed": [_plain(thing) for thing in world.removed],
            "held": held,
            "tool": [arm.tool_pose.rotation.tolist(), arm.tool_pose.position.tolist()],
        }
        text = json.dumps(state).encode()
        # In one go, and never shorter than before: who reads it finds one state and then blanks.
        self._length = max(self._length, len(text))
        try:
            os.pwrite(self._file, text.ljust(self._length), 0)
        except OSError as error:
            self.close()
            raise Fault(
                f'the state of the world "{self._path}" cannot be written: {reason_of(error)}; '
                "the run stops because it could not be taken up again"
            ) from error

    def close(self) -> None:
        """Close the file; more calls do nothing."""
        if self._file is not None:
            file, self._file = self._file, None
            os.close(file)


def read_state(path: Path) -> Mapping[str, Any]:
    """Return the state that a log holds.

    Raises:
        InputError: There is none.
    """
    try:
        state: Mapping[str, Any] = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(
            f'the world cannot be rebuilt from "{path}": {error}; run the mission again from its start'
        ) from error
    return state


def restore(state: Mapping[str, Any], world: FakeWorld, arm: FakeArm) -> None:
    """Bring world and arm into a state; the arm stands still in it."""
    world.steps = state["steps"]
    world.objects[:] = [_object(plain) for plain in state["objects"]]
    world.removed[:] = [_object(plain) for plain in state["removed"]]
    world.held = None if state["held"] is None else world.objects[state["held"]]
    rotation, position = state["tool"]
    arm.put(Pose(np.array(rotation), np.array(position)))


def _plain(thing: FakeObject) -> list[Any]:
    return [thing.label, thing.position.tolist(), [place.tolist() for place in thing.stood], thing.fell]


def _object(plain: list[Any]) -> FakeObject:
    label, position, stood, fell = plain
    thing = FakeObject(label, np.array(position))
    thing.stood, thing.fell = [np.array(place) for place in stood], fell
    return thing
