"""Finding installed detectors and building those that a cell file asks for."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Protocol

from executive.cell import Clock, Detector
from executive.cell_config import CameraConfig, DetectorConfig
from executive.errors import InputError

GROUP = "executive.detectors"


class ClosableDetector(Detector, Protocol):
    """A detector that holds something (a thread, a session) until it is closed."""

    def close(self) -> None:
        """Give everything back; waits for the answer under way."""


def installed() -> dict[str, EntryPoint]:
    """Return the installed kinds of detectors by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def build_detectors(
    configs: Mapping[str, DetectorConfig], *, camera: CameraConfig, clock: Clock, base: Path
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file by name, in its order.

    Args:
        configs: The detectors section of the cell file.
        camera: The camera whose frames they search.
        clock: The run's clock, on which their answers become visible.
        base: Folder that paths in their options start from.

    Raises:
        InputError: A kind is not installed, or an option is wrong.
    """
    kinds = installed()
    built: dict[str, ClosableDetector] = {}
    for name, config in configs.items():
        if config.kind not in kinds:
            raise InputError(
                f'detector "{name}" is of kind "{config.kind}", which is not installed; '
                f"installed: {', '.join(sorted(kinds)) or 'none'}"
            )
        built[name] = kinds[config.kind].load().from_config(config, camera=camera, clock=clock, base=base)
    return built
