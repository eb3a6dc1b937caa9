"""Cell of a replay: bins, classes and a ledger, while a tape answers for every other part."""

from __future__ import annotations

from executive.cell.config import CellConfig
from executive.cell.layout import bins_of, cell_without_hardware
from executive.cell.protocols import Cell, Routes
from executive.cell.workcell import CellOptions, Workcell
from executive.events import Emit
from executive.ledger.tracker import ItemLedger
from executive.perception.evidence import classes_distinct_by_touch


class PlayedCell(Workcell):
    """What decisions rest on beside a cell's answers: nothing to log, to be seen, to audit or to close.

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
        self._ledger = ItemLedger(
            config.ledger, config.table, bins_of(config), routes, emit, classes_distinct_by_touch(config)
        )
        self._cell = cell_without_hardware(config, routes, self._ledger, emit)

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

    def advance(self) -> None:
        """Let one control step pass."""
        self._steps += 1
