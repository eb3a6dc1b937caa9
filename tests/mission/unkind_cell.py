"""A fake cell in which not everything goes well, so that missions go their ways of failure."""

from __future__ import annotations

import random
import signal
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

from executive.cell.config import CellConfig
from executive.cell.detection import Detection
from executive.cells.fake.arm import FakeMotion
from executive.cells.fake.cell import FakeCell
from executive.errors import Unreachable

LONGEST = 4000
"""Control steps after which a run is halted as by Ctrl-C; one in five is halted earlier."""


class UnkindCell(FakeCell):
    """A fake cell in which now and then a grasp misses, a look is of no use, or something is in the way."""

    def __init__(self, config: CellConfig, *, seed: int, **more: Any) -> None:
        super().__init__(config, seed=seed, **more)
        self._unkindness = random.Random(seed)
        self.has_dropped = False
        self._longest = self._unkindness.randrange(1, LONGEST) if self._happens(0.2) else LONGEST
        self._sees_all, self._plan, self._open = self.camera.is_table_visible, self.arm.plan, self.tool.open
        self.tool.can_seal = lambda: not self._happens(0.2)
        self.camera.is_table_visible = lambda: not self._happens(0.1) and self._sees_all()
        self.arm.plan, self.tool.open = self._plan_or_not, self._open_or_not  # type: ignore[method-assign]
        for detector in self.detectors.values():
            detector.make_answer = self._answer

    def advance(self) -> None:
        super().advance()
        if self.world.held_object is not None and not self.arm.at_rest and self._happens(0.0005):
            self.has_dropped = True
            self._open()
        if self.steps == self._longest:
            signal.raise_signal(signal.SIGINT)

    def _happens(self, share: float) -> bool:
        return self._unkindness.random() < share

    def _plan_or_not(self, *args: Any, **more: Any) -> Any:
        if self._happens(0.02):
            self.arm.next_obstacle = "the arm ran into something"
        plan = self._plan(*args, **more)
        if not self._happens(0.03):
            return plan
        future = Future[FakeMotion]()
        future.set_exception(Unreachable("the arm does not like it"))
        return replace(plan, future=future)

    def _open_or_not(self) -> None:
        # A grasp that is taken back lets go for sure: no skill looks whether it did.
        if self.ledger.find_held_item() is None or not self._happens(0.05):
            self._open()

    def _answer(self, look: int, true: Sequence[Detection]) -> Sequence[Detection] | str:
        if self._happens(0.05):
            return "the line is busy"
        if self._happens(0.15):
            return [Detection(seen.label, 0.3, seen.box) for seen in true]
        return [seen for seen in true if not self._happens(0.1)]
