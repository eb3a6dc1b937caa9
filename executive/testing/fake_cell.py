"""Fake cell for tests of skills and missions: the station of a driver without physics."""

from __future__ import annotations

import functools
from pathlib import Path

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.protocols import Routes
from executive.drivers.fake import FakeDriver
from executive.events import Emit, discard_event
from executive.mission.cell_file import load_cell
from executive.perception.detectors.cell_detector import TruthDetector
from executive.perception.detectors.detector_registry import DetectorContext
from executive.station.station import CellOptions, SilentOperator, Station
from executive.text.files import get_shipped_folder

SHIPPED_ROUTES = {"cube": ("red_bin",), "sphere": ("blue_bin",), "duck": ("yellow_bin",)}
"""Permitted bins of each class of the shipped cells."""


class FakeCell(Station):
    """A station without physics; by default of the shipped cell `overhead`, without objects.

    The arm follows motions exactly, the tool always holds what it touches, and every detector finds all
    objects.

    Attributes:
        world: Objects and bins.
        arm: The fake arm.
        tool: The fake tool.
        camera: The fake camera.
        detectors: What finds the objects in frames for each detector, by name of the detector.
        detector: The first detector.
        ledger: The ledger of the run.
    """

    driver: FakeDriver

    def __init__(
        self,
        config: CellConfig | None = None,
        *,
        seed: int = 0,
        routes: Routes = SHIPPED_ROUTES,
        emit: Emit = discard_event,
        options: CellOptions | None = None,
        kind: type[FakeDriver] = FakeDriver,
    ) -> None:
        self.detectors: dict[str, TruthDetector] = {}

        def make_detector(section: DetectorConfig, context: DetectorContext) -> TruthDetector:
            self.detectors[context.name] = TruthDetector.from_config(section, context)
            return self.detectors[context.name]

        super().__init__(
            config or load_empty_cell(),
            kind,
            seed=seed,
            routes=routes,
            emit=emit,
            options=options or CellOptions(SilentOperator(), cell_folder=Path()),
            make_detector=make_detector,
        )
        self.world = self.driver.world
        self.arm = self.driver.arm
        self.tool = self.driver.tool
        self.camera = self.driver.camera
        self.detector = next(iter(self.detectors.values()))


@functools.cache
def load_empty_cell() -> CellConfig:
    """Return the shipped cell `overhead` as a fake cell without objects, for tests of single skills."""
    path = get_shipped_folder() / "cells" / "overhead.yaml"
    return load_cell(path, {"cell.kind": "fake", "cell.table.objects": "[0, 0]"})
