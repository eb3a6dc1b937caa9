"""Decorator of a work cell that adds callbacks before and after every control step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from executive.cell import Cell
from executive.scenery import Scenery
from executive.workcell import Accounts, Workcell


def _do_nothing() -> None:
    """Do nothing."""


class CellWrapper:
    """Forwards everything to another work cell, unless a subclass overrides it; implements `Workcell`.

    Args:
        inner: The work cell inside this wrapper.
        before: Called before every control step.
        after: Called after every control step.

    Attributes:
        inner: The work cell inside this wrapper.
    """

    def __init__(
        self,
        inner: Workcell,
        *,
        before: Callable[[], None] = _do_nothing,
        after: Callable[[], None] = _do_nothing,
    ) -> None:
        self.inner = inner
        self._before, self._after = before, after

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""
        return self.inner.cell

    @property
    def accounts(self) -> Accounts:
        """The ledger; at its end, the run closes the ledger and reads its counts and rows."""
        return self.inner.accounts

    @property
    def steps(self) -> int:
        """Number of control steps since the run began."""
        return self.inner.steps

    def log_to(self, path: Path) -> None:
        """Start a log file from which the simulated world can be rebuilt."""
        self.inner.log_to(path)

    def advance(self) -> None:
        """Let one control step pass, with the calls before and after it."""
        self._before()
        self.inner.advance()
        self._after()

    def scenery(self) -> Scenery | None:
        """Return the scene for viewers, or None if the cell has none."""
        return self.inner.scenery()

    def audit(self) -> Mapping[str, int] | None:
        """Return the true final counts of the objects, or None if they are unknown."""
        return self.inner.audit()

    def close(self) -> None:
        """Release all resources."""
        self.inner.close()


def innermost(workcell: Workcell) -> Workcell:
    """Return the work cell inside all wrappers."""
    while isinstance(workcell, CellWrapper):
        workcell = workcell.inner
    return workcell
