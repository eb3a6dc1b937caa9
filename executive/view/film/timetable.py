"""Which control step of a run each frame of its film shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

HOLD = 2.0
"""How long the end is shown [s]."""


@dataclass(frozen=True)
class Timetable:
    """The frames of a film.

    Attributes:
        steps: Control steps of the run.
        step: Length of a control step [s].
        rate: Frames per second.
        speed: Seconds on the robot's clock per second of the film.
    """

    steps: int
    step: float
    rate: float
    speed: float

    @property
    def shown(self) -> list[int]:
        """The control steps that are shown, in order, from the first to the last."""
        each = self.speed / self.rate / self.step
        frames = math.ceil(self.steps / each)
        return [min(round(frame * each), self.steps) for frame in range(frames + 1)]

    @property
    def held(self) -> int:
        """Frames for which the end is shown."""
        return round(HOLD * self.rate)

    @property
    def frames(self) -> int:
        """Frames in all."""
        return len(self.shown) + self.held

    def clock(self, step: int) -> float:
        """Return the time [s] on the robot's clock after so many control steps."""
        return step * self.step
