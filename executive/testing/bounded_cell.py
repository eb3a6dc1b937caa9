"""Work cell with a limit in time: a mission that never ends is a failed test, not a hanging one."""

from __future__ import annotations

from executive.cell.cell_wrapper import CellWrapper
from executive.cell.workcell import Workcell
from executive.errors import Fault


class BoundedCell(CellWrapper):
    """A work cell in which a run ends as a fault once it has lasted too long.

    The fault is raised once, so that the arm can be braked afterwards.

    Args:
        inner: The cell.
        longest: That time, on the run's clock [s].
    """

    def __init__(self, inner: Workcell, longest: float) -> None:
        super().__init__(inner, self._check)
        self._longest = longest
        self._expired = False

    def _check(self) -> None:
        if not self._expired and self.cell.clock.now > self._longest:
            self._expired = True
            raise Fault(f"the mission is not done after {self._longest:g} s on its clock")
