"""A work cell that does not wait for ever: a mission that never ends is a failed test, not a hanging one."""

from __future__ import annotations

from executive.errors import Fault
from executive.testing.wrapped_cell import WrappedCell
from executive.workcell import Workcell


class BoundedCell(WrappedCell):
    """A work cell in which a run ends as a fault once it has lasted too long.

    Args:
        inner: The cell.
        longest: That time, on the run's clock [s].
    """

    def __init__(self, inner: Workcell, longest: float) -> None:
        super().__init__(inner)
        self._longest = longest
        self._expired = False

    def advance(self) -> None:
        """Let one control step pass.

        Raises:
            Fault: The time is over; only the first time, so that the arm can be braked.
        """
        self.inner.advance()
        if not self._expired and self.cell.clock.now > self._longest:
            self._expired = True
            raise Fault(f"the mission is not done after {self._longest:g} s on its clock")
