"""A cell that is not there: bins, classes and a ledger, while a tape answers for everything else."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from executive.cell import Cell, Routes
from executive.cell_config import CellConfig
from executive.events import Emit
from executive.layout import as_bin, as_class
from executive.ledger.ledger import ItemLedger
from executive.messages import Target
from executive.workcell import CellOptions


class Absent:
    """A part that nobody asks: the tape does not let a question through while it plays."""

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"nothing asks the cell while a tape plays, and this asked for {name}")


class PlayedCell:
    """What decisions rest on beside a cell's answers; implements `executive.workcell.Workcell`.

    Args:
        config: The cell file.
        seed: Decides nothing.
        routes: Class label to the bins that are right for it.
        emit: Tells the run what happens.
        options: What the run wants; the operator's answers are on the tape.
    """

    def __init__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> None:
        del seed, options
        self._steps = 0
        bins = {name: as_bin(name, bin) for name, bin in config.bins.items()}
        self._ledger = ItemLedger(config.ledger, config.table, bins, routes, emit)

        def decided(target: Target, bin: str) -> None:
            emit("decision", item=target.item, label=target.label, frame=target.frame, bin=bin)

        absent: Any = Absent()
        self._cell = Cell(
            clock=absent,
            arm=absent,
            tool=absent,
            camera=absent,
            detectors=dict.fromkeys(config.detectors, absent),
            ledger=self._ledger,
            operator=absent,
            bins=bins,
            classes={label: as_class(label, kind) for label, kind in config.objects.items()},
            routes=dict(routes),
            localizer=absent,
            safe_place=np.array(config.safe_place),
            descent=config.motion.descent,
            descent_speed=config.motion.descent_speed,
            decided=decided,
        )

    @property
    def cell(self) -> Cell:
        """What skills see."""
        return self._cell

    @property
    def accounts(self) -> ItemLedger:
        """The books of the cell's ledger."""
        return self._ledger

    @property
    def steps(self) -> int:
        """Control steps made so far."""
        return self._steps

    def log_to(self, path: Path) -> None:
        """Have nothing to keep."""

    def advance(self) -> None:
        """Let one control step pass."""
        self._steps += 1

    def scenery(self) -> None:
        """Return None: there is nothing to be seen."""

    def audit(self) -> Mapping[str, int] | None:
        """Return None: nobody can know."""
        return None

    def close(self) -> None:
        """Have nothing to give back."""
