"""Skills that change, take or open what they must not, each in its own way."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from concurrent.futures import Future
from itertools import count
from typing import Any, ClassVar

from conforming_skills import Pause, Push

from executive.cell import Cell, LeastTimes, Steps
from executive.messages import Item, Target
from executive.skill import HOLDING, In, Metres, Out, Skill, param, port


class Forgetful(Pause):
    """Wait."""

    chosen: Out[Item] = port(refers="item", doc="what was chosen")


class Miscounting(Pause):
    """Wait."""

    chosen: Out[Item] = port(refers="item", doc="what was chosen")

    def run(self, cell: Cell) -> Steps:
        """Choose a number."""
        yield
        self.chosen = 3  # type: ignore[assignment]


class Inventing(Pause):
    """Wait."""

    bins: Out[list[str]] = port(refers="bin", doc="what was chosen")

    def run(self, cell: Cell) -> Steps:
        """Choose what is not there."""
        yield
        self.bins = ["red_bin", "green_bin"]


class Scribbling(Pause):
    """Wait."""

    gap: Metres = param(0.1, doc="how far")

    def run(self, cell: Cell) -> Steps:
        """Keep notes in the open."""
        self.count, self._private = 1, 2
        yield
        self.gap = 0.2


class Overwriting(Pause):
    """Wait."""

    targets: In[list[Target]] = port(doc="what there is")

    def run(self, cell: Cell) -> Steps:
        """Forget what was given."""
        yield
        self.targets = []


class Greedy(Pause):
    """Wait."""

    targets: In[list[Target]] = port(doc="what there is")

    def run(self, cell: Cell) -> Steps:
        """Take the first away."""
        yield
        self.targets.pop(0)


class Presumptuous(Skill):
    """Do as one likes."""

    def run(self, cell: Cell) -> Steps:
        """Use what was not asked for."""
        yield
        cell.camera.capture()
        cell.operator.ask(())
        cell.arm.stop()


class Sneaking(Push):
    """Push the target aside."""

    moves: ClassVar = False


class Moody(Pause):
    """Wait."""

    runs: ClassVar = count()

    def run(self, cell: Cell) -> Steps:
        """Ask what nobody asked before."""
        yield
        cell.camera.area(f"part {next(self.runs)}")


class Restless(Pause):
    """Wait."""

    runs: ClassVar = count()

    def run(self, cell: Cell) -> Steps:
        """Wait every other time."""
        if next(self.runs) % 2:
            yield


class Slow(Skill):
    """Hold on."""

    tool_state: ClassVar = (HOLDING, HOLDING)

    def run(self, cell: Cell) -> Steps:
        """Block."""
        yield
        try:
            Future[None]().result(timeout=0.06)
        except TimeoutError:
            return


class Boasting(Pause):
    """Wait."""

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Promise too much."""
        return 1.0


class Demanding(Pause):
    """Wait."""

    gap: Metres = param(doc="how far")

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Ask for what a mission need not say."""
        return float(given["gap"])


class Clockwatching(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait by another clock."""
        yield
        sys.modules["time"].sleep(1000.0)


class Leaking(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Open a file."""
        self._file = open(os.devnull)  # noqa: SIM115
        yield
