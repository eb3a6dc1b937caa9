"""Wrapper of a work cell: base class of work cells that change some methods of another work cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.cell.visuals import Visuals
from executive.cell.workcell import Workcell


class CellWrapper:
    """Work cell that forwards each call to another work cell; a subclass overrides some methods.

    Attributes:
        inner: The wrapped work cell.
        cell: Interface of the work cell for skills.
        accounts: The ledger; the run closes it at its end, so that each item has a final state.
    """

    def __init__(self, inner: Workcell) -> None:
        self.inner, self.cell, self.accounts = inner, inner.cell, inner.accounts

    @property
    def steps(self) -> int:
        """Number of control steps since the start of the run."""
        return self.inner.steps

    @property
    def last_command_step(self) -> int:
        """Control step of the last command to the arm or the tool."""
        return self.inner.last_command_step

    def log_to(self, path: Path) -> None:
        """Start a log file from which the simulated world can be reconstructed."""
        self.inner.log_to(path)

    def advance(self) -> None:
        """Execute one control step."""
        self.inner.advance()

    def visuals(self) -> Visuals | None:
        """Return the shapes and poses of the bodies for displays, or None if the cell has no visuals."""
        return self.inner.visuals()

    def audit(self) -> Mapping[str, int] | None:
        """Return the true object counts by `AUDIT_KEYS`, or None if the counts are unknown."""
        return self.inner.audit()

    def close(self) -> None:
        """Release all resources of the cell."""
        self.inner.close()


def find_innermost_cell(workcell: Workcell) -> Workcell:
    """Return the work cell inside all wrappers."""
    while isinstance(workcell, CellWrapper):
        workcell = workcell.inner
    return workcell
