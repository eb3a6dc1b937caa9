"""Skills that do not come back, each from somewhere else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from conforming_skills import Pause

from executive.cell import Cell, LeastTimes, Steps
from executive.skill import EMPTY


class Looping(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait without a yield."""
        yield
        while True:
            try:
                cell.camera.area("table")
            except Exception:
                return


class Despairing(Pause):
    """Wait."""

    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Wait without a yield for what is gone."""
        yield
        while not cell.ledger.is_open("cube-1"):
            pass


class Clutching(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Never let go."""
        done = False
        try:
            yield
            done = True
        finally:
            while not done:
                pass


class Pondering(Pause):
    """Wait."""

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Think about it."""
        while True:
            pass
