"""A work cell inside another one that does something more."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.cell import Cell
from executive.scenery import Scenery
from executive.workcell import Accounts, Workcell


class WrappedCell:
    """A work cell that is another one, but for what a subclass changes; implements `Workcell`.

    Attributes:
        inner: The other one.
    """

    def __init__(self, inner: Workcell) -> None:
        self.inner = inner

    @property
    def cell(self) -> Cell:
        """What skills see."""
        return self.inner.cell

    @property
    def accounts(self) -> Accounts:
        """The books of the cell's ledger."""
        return self.inner.accounts

    @property
    def steps(self) -> int:
        """Control steps that its world has made since the run began."""
        return self.inner.steps

    def log_to(self, path: Path) -> None:
        """Keep in a file, from now on, what its world can be rebuilt from."""
        self.inner.log_to(path)

    def advance(self) -> None:
        """Let one control step pass."""
        self.inner.advance()

    def scenery(self) -> Scenery | None:
        """Return what there is to be seen."""
        return self.inner.scenery()

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects, or None where nobody can know."""
        return self.inner.audit()

    def close(self) -> None:
        """Give everything back."""
        self.inner.close()


def innermost(workcell: Workcell) -> Workcell:
    """Return the cell inside all that is wrapped around it."""
    while isinstance(workcell, WrappedCell):
        workcell = workcell.inner
    return workcell
