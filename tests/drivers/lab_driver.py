"""Driver of a laboratory cell, an example to copy: an arm that jumps, a list of images, a tool with a flag.

The entry point in the group `executive.drivers` is `lab = "lab_driver:LabDriver"`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from executive.cell.arm import Motion, MotionGuard
from executive.cell.config import CellConfig
from executive.cell.devices import DEFAULT_ROLE, CameraImage, DriverOptions, StepClock
from executive.geometry import Array
from executive.motion.joints import build_kinematics
from executive.text.validate import KeyPath

IMAGES = "images.npy"
"""File beside the cell file: images `(N, H, W, 3)` of the table before the first pick and after each pick."""
OBJECT_HEIGHT = 0.05
"""Height of all objects [m]."""
OBJECT_WEIGHT = 1.0  # Weight of all objects [N].
GUARD_PERIOD = 0.001  # Time between two checks of a guard on the path of a motion [s].


class LabArm:
    """An arm that is at the end of a motion at once, or where a guard stops it."""

    at_rest = True
    collision = None
    contact_point = None

    def __init__(self, config: CellConfig) -> None:
        self.q = np.radians(config.arm.poses_deg["home"])
        self.qd = np.zeros_like(self.q)
        self.tool = LabTool(self)
        self._kinematics = build_kinematics(config)

    @property
    def end_q(self) -> Array:
        return self.q

    @property
    def tip_height(self) -> float:
        """Height of the tip of the tool above the table [m]."""
        return float(self._kinematics.compute_tool_pose(self.q).position[2])

    def execute(self, motion: Motion, guard: MotionGuard) -> None:
        """Jump along the path of a motion."""
        if guard.lost_grip and not self.tool.holding:
            return
        for time in np.arange(0.0, motion.duration + GUARD_PERIOD, GUARD_PERIOD):
            was_touching = self.tool.touching
            self.q = motion.state_at(time).q
            if guard.touch and self.tool.touching and not was_touching:
                return

    def stop(self) -> None:
        """The arm is always at rest."""


class LabTool:
    """A tool that holds whatever it touches when it closes."""

    load_std = 0.01
    opening = 0.0

    def __init__(self, arm: LabArm) -> None:
        self.holding = False
        self.pick_count = 0
        self._arm = arm

    @property
    def touching(self) -> bool:
        return self._arm.tip_height <= OBJECT_HEIGHT

    @property
    def holding_force(self) -> float:
        return 10.0 if self.holding else 0.0

    @property
    def load(self) -> float:
        return OBJECT_WEIGHT if self.holding else 0.0

    def close(self) -> None:
        self.holding = self.touching
        self.pick_count += self.holding

    def open(self, opening: float = 0.0) -> None:
        self.holding = False


class LabDriver:
    """The devices of the laboratory cell; implements `executive.cell.devices.Driver`."""

    def __init__(self, config: CellConfig, options: DriverOptions) -> None:
        self.clock = StepClock(config.clock.step)
        self.arm = LabArm(config)
        self.arms = {DEFAULT_ROLE: self.arm}
        self.tools = {DEFAULT_ROLE: self.arm.tool}
        self.cameras = dict.fromkeys(config.cameras, self)
        self._images = np.load(options.cell_folder / IMAGES)

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield an error if there are no images."""
        if not (cell_folder / IMAGES).is_file():
            yield ("kind",), f"the folder of the cell file has no {IMAGES}"

    def capture(self) -> CameraImage:
        """Show the table after the last pick."""
        image = self._images[self.arm.tool.pick_count]
        image[0, 0, 0] = round(240 * self.clock.now) % 256  # No camera gives the same pixels twice.
        visible = np.pad(np.ones((256, 256), np.bool_), ((100, 124), (192, 192)))  # without arm and bins
        return CameraImage(image, None, self.clock.now, visible)

    def close(self) -> None:
        """There is nothing to release."""
