"""Skills that conform, and skills with one realistic mistake each, named after the mistake."""

from __future__ import annotations

import random
import sys
from typing import Any, ClassVar

from executive.cell.arm import Goal
from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import follow, make_task, plan, transport
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Out, Seconds, Skill, param, port


class Push(Skill):
    """Push the target aside."""

    target: In[Target] = port(doc="what to push")
    height: Metres = param(0.05, ge=0.0, le=0.2, doc="above the target's middle")
    reasons: ClassVar = ("unreachable", "blocked")
    uses: ClassVar = ("arm",)
    moves: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        x, y, z = (float(value) for value in self.target.position)
        motion = yield from plan(self, cell.arm, lambda: (Goal((x, y, z + self.height)), make_task(cell)))
        yield from follow(self, cell, motion)


class Pause(Skill):
    """Wait for two control steps."""

    reasons: ClassVar = ("tired",)

    def run(self, cell: Cell) -> Steps:
        yield
        yield


class GraspTarget(Skill):
    """Grasp the target."""

    target: In[Target] = port(doc="what the tool touches")
    reasons: ClassVar = ("missed",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (EMPTY, HOLDING)


class Undocumented(Pause):
    gap: Metres = param(0.1)
    target: In[Target]


class BadDefaults(Pause):
    near: Metres = param(0.1, ge=0.2, doc="how near")
    far: Metres = param(0.3, le=0.2, doc="how far")
    edge: Metres = param(0.2, ge=0.2, le=0.2, doc="both bounds are allowed")
    order: str = param("rows", choices=("columns", "none"), doc="in which order")
    gap: Metres = param("wide", doc="how far apart")
    limit: float | None = param(None, ge=1, doc="at most [-]")


class RaisesUndeclared(Pause):
    def run(self, cell: Cell) -> Steps:
        yield
        if cell.bins:
            raise self.failure("too_many", "there are bins")


class TextForTuple(Pause):
    reasons: ClassVar = "tired"
    uses: ClassVar = "arm"


class BadResources(Pause):
    uses: ClassVar = ("gripper", "tool")
    moves: ClassVar = True
    tool_state_after_failure: ClassVar = {"dropped": EMPTY, "halt": EMPTY, "tired": EMPTY}


class StartsGenerator(Push):
    def run(self, cell: Cell) -> Steps:
        cell.arm.start(plan(self, cell.arm, lambda: ("aside", make_task(cell))))  # type: ignore[arg-type]
        yield


class AlwaysFails(Pause):
    def run(self, cell: Cell) -> Steps:
        yield
        raise self.failure("tired", "after 1 step")


class Shake(Skill):
    """Shake the held item up and down, around the height at which it is held."""

    held: In[Item] = port(refers_to="item", doc="the item in the tool")
    reasons: ClassVar = ("unreachable", "blocked", "dropped")
    uses: ClassVar = ("arm", "tool")
    moves: ClassVar = True
    tool_state: ClassVar = (HOLDING, HOLDING)
    tool_state_after_failure: ClassVar = {"dropped": EMPTY, "halt": ANY}
    strokes: ClassVar = (0.03, -0.03, 0.0)

    def run(self, cell: Cell) -> Steps:
        x, y, z = (float(value) for value in cell.arm.tool_pose.position)
        for stroke in self.strokes:
            yield from transport(self, cell, self.held, Goal((x, y, z + stroke)), "its place")


class ShakeInTheAir(Shake):
    """Shake the held item above the place where it is held."""

    strokes: ClassVar = (0.06, 0.03, 0.0)


class NeedsUnknown(Pause):
    plan: In[dict[str, int]] = port(doc="what is to come")
    words: In[str] = port(doc="what to say")


class WaitsForEver(Pause):
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        while not cell.tool.holding:
            yield


class LoopsWithoutYield(Pause):
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        yield
        while cell.ledger.change_count > 0:
            try:
                cell.camera.get_view_box("table")
            except Exception:
                return


class LoopsInConstructor(Pause):
    tool_state: ClassVar = (EMPTY, EMPTY)

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        while values is not None:
            pass


class TrustsTheDetector(Skill):
    uses: ClassVar = ("camera",)
    senses: ClassVar = True

    def run(self, cell: Cell) -> Steps:
        request = next(iter(cell.detectors.values())).request(cell.camera.capture(), "table")
        while not request.ready:
            yield
        _ = request.result().confident[0]


class FailsWithoutSentence(Pause):
    def run(self, cell: Cell) -> Steps:
        yield
        if cell.tool.holding:
            raise self.failure("tired", " ")


class WrongOutputs(Pause):
    chosen: Out[Item] = port(refers_to="item", doc="what was chosen")
    targets: Out[list[Target]] = port(doc="what there is")
    length: Out[float | None] = port(doc="how long")

    def run(self, cell: Cell) -> Steps:
        yield
        self.chosen, self.targets, self.length = 3, ["cube-1"], 1  # type: ignore[assignment, list-item]


class ChangesInput(Pause):
    targets: In[list[Target]] = port(doc="what there is")

    def run(self, cell: Cell) -> Steps:
        yield
        self.targets.pop(0)


class UsesUndeclared(Skill):
    def run(self, cell: Cell) -> Steps:
        yield
        cell.camera.capture()
        cell.operator.ask(())
        cell.arm.stop()


class MovesUndeclared(Push):
    moves: ClassVar = False


class LetsGo(Skill):
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (HOLDING, HOLDING)

    def run(self, cell: Cell) -> Steps:
        yield
        cell.tool.open()


class GraspsInSecret(GraspTarget):
    def run(self, cell: Cell) -> Steps:
        yield
        cell.tool.close()
        if not cell.tool.holding:
            cell.tool.open()
            raise self.failure("missed", "no seal")


class HoldsOnWhenHalted(GraspTarget):
    def run(self, cell: Cell) -> Steps:
        cell.tool.close()
        yield
        if not cell.tool.holding:
            cell.tool.open()
            raise self.failure("missed", "no seal")
        cell.ledger.record_grasp(self.target.item)


class RunsOnWhenHalted(Push):
    def run(self, cell: Cell) -> Steps:
        motion = yield from plan(self, cell.arm, lambda: ("aside", make_task(cell)))
        cell.arm.start(motion)
        while not cell.arm.at_rest:
            yield
        if cell.arm.collision:
            raise self.failure("blocked", cell.arm.collision)


class WaitsInFinally(Pause):
    def run(self, cell: Cell) -> Steps:
        try:
            yield
        finally:
            yield from cell.clock.sleep(0.1)


class DependsOnChance(Pause):
    chosen: Out[float] = port(doc="what was chosen")

    def run(self, cell: Cell) -> Steps:
        yield
        self.chosen = random.random()


class CallsByChance(Pause):
    def run(self, cell: Cell) -> Steps:
        yield
        cell.camera.get_view_box(str(random.random()))


class WaitsByChance(Pause):
    runs: ClassVar[list[int]] = []

    def run(self, cell: Cell) -> Steps:
        self.runs.append(0)
        if len(self.runs) % 2:
            yield


class ComputesTooLong(Skill):
    tool_state: ClassVar = (HOLDING, HOLDING)
    work: Seconds = param(0.06, doc="time that it blocks")

    def run(self, cell: Cell) -> Steps:
        yield
        sys.modules["time"].sleep(self.work)


class BusyCondition(Pause):
    """Count the boxes in a new image, and call this a condition."""

    count: Out[int] = port(doc="number of boxes")
    is_condition: ClassVar = True
    uses: ClassVar = ("camera",)
    senses: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        cell.ledger.is_table_empty()
        cell.camera.capture()
        yield
        cell.ledger.invalidate_positions()
        self.count = 1
