"""Base class of the simulated and the fake cell: a cell without hardware, and an operator for tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.cell.arm import Arm
from executive.cell.clock import STEP, StepClock
from executive.cell.config import CellConfig
from executive.cell.layout import build_bins, build_object_classes
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Detector, Localizer, Routes, Tool
from executive.cell.visuals import Visuals
from executive.cell.workcell import CellOptions
from executive.cells.ground_truth import FinalObject, count_outcomes
from executive.events import Emit, TargetSelected
from executive.ledger.tracker import Tracker
from executive.perception.camera_model import MountedCamera
from executive.perception.detectors.screening import screen_detectors


class SilentOperator:
    """Operator without a terminal, who requests the classes of a list in order."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next class of the list, or None at the end of the list."""
        del choices
        return self._requests.pop(0) if self._requests else None


class CellWithoutHardware:
    """Clock, bins, classes and ledger of a cell; implements `executive.cell.workcell.Workcell`.

    Arm, tool, camera, detectors and localizer of `cell` are None until a subclass adds them. A replay uses
    this class itself.

    Args:
        config: The cell file.
        seed: Random seed of the run; not used.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run.

    Attributes:
        config: The cell file.
        routes: Names of the permitted bins of each class.
        accounts: The ledger of the run.
        cell: The interface of the cell for skills.
        steps: Number of control steps since the start of the run.
        last_command_step: Control step of the last logged command to arm or tool; 0 if there is none.
    """

    def __init__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> None:
        del seed
        self.config, self.routes = config, dict(routes)
        self.steps = self.last_command_step = 0
        bins, classes = build_bins(config), build_object_classes(config)
        ignored = set(config.unknown.ignore).difference(classes)
        self.accounts = Tracker(
            config.ledger, config.table, bins, classes, self.routes, options.quotas, emit, ignored
        )
        no_device: Any = None

        def emit_selection(target: Target, bin: str) -> None:
            emit(TargetSelected(target.item, target.label, target.frame, bin))

        self.cell = Cell(
            clock=StepClock(lambda: self.steps * STEP),
            arm=no_device,
            tool=no_device,
            camera=no_device,
            detectors=dict.fromkeys(config.detectors, no_device),
            ledger=self.accounts,
            operator=options.operator,
            bins=bins,
            classes=classes,
            routes=self.routes,
            localizer=no_device,
            safe_place=np.array(config.safe_place),
            descent=config.motion.descent,
            slow_descent=config.motion.slow_descent,
            descent_speed=config.motion.descent_speed,
            report_selection=emit_selection,
            quotas=options.quotas,
        )

    def _connect(
        self,
        options: CellOptions,
        arm: Arm,
        tool: Tool,
        camera: MountedCamera,
        detectors: Mapping[str, Detector],
        localizer: Localizer,
    ) -> None:
        """Add the parts that skills use to `cell`; the camera of a resumed run continues to count."""
        if options.resume is not None:
            camera.set_counts(options.resume.frame_count, options.resume.pose_count)
        screened = screen_detectors(detectors, self.cell.classes)
        self.cell = replace(
            self.cell, arm=arm, tool=tool, camera=camera, detectors=screened, localizer=localizer
        )

    def log_to(self, path: Path) -> None:
        """Do nothing: without hardware or physics, there is no world to log."""

    def advance(self) -> None:
        """Count one control step."""
        self.steps += 1

    def visuals(self) -> Visuals | None:
        """Return None: the cell has no shapes to show."""
        return None

    def audit(self) -> Mapping[str, int] | None:
        """Return the number of objects by `AUDIT_KEYS`; None if the true positions are unknown."""
        if (objects := self._list_final_objects()) is None:
            return None
        gate = self.config.ledger.gate
        ignored = self.accounts.ignored_positions
        return count_outcomes(objects, self.accounts.records, self.cell.bins, self.routes, gate, ignored)

    def _list_final_objects(self) -> Iterable[FinalObject] | None:
        """Return all objects at the end of the run; None if their true positions are unknown."""
        return None

    def close(self) -> None:
        """Do nothing: the cell holds no resources."""
