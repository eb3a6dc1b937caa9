"""What a detector is built into."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from executive.cell.config import CameraConfig
from executive.cell.protocols import Clock, Detector


class ClosableDetector(Detector, Protocol):
    """A detector that holds something (a thread, a session) until it is closed."""

    def close(self) -> None:
        """Give everything back; waits for the answer under way."""


@dataclass(frozen=True)
class DetectorSetting:
    """What a detector is built into.

    Attributes:
        name: Its name in the cell file.
        camera: The camera whose frames it searches.
        clock: The run's clock, on which its answers become visible.
        base: Folder that paths in its options start from.
        seed: Seed of whatever is random in it.
        other: Returns another detector of the cell by name, built if need be; who asks does not close it.
    """

    name: str
    camera: CameraConfig
    clock: Clock
    base: Path
    seed: int
    other: Callable[[str], Detector]
