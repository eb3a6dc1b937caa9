"""Work cell around another one, with more to do at every control step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from executive.cell import Cell
from executive.scenery import Scenery
from executive.workcell import Accounts, Workcell


def _do_nothing() -> None:
    """Do nothing."""


class WrappedCell:
    """A work cell that is another one, but for what a subclass changes; implements `Workcell`.

    Args:
        inner: The other one.
        before: Called before every control step.
        after: Called after every control step.

    Attributes:
        inner: The other one.
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
        """Let one control step pass, with the calls before and after it."""
        self._before()
        self.inner.advance()
        self._after()

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
