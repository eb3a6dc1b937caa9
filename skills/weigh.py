"""Skill that weighs the held item."""

from __future__ import annotations

import math

from executive.cell.arm import Goal
from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import fail_if_dropped, transport
from executive.manipulation.tool_goals import choose_bin
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Newtons, Out, Seconds, Skill, param, port


class Weigh(Skill):
    """Lift the held item, and determine its class and its bin by its weight.

    The weight is the load minus the load of the empty tool before the approach. The skill fails with
    `implausible` if the load cell is broken: its readings are all equal, or no finite numbers.
    """

    held: In[Item] = port(refers_to="item", doc="the item in the tool")
    weight: Out[Newtons] = port(doc="the weight of the item")
    bin: Out[str] = port(refers_to="bin", doc="the bin for the item")
    height: Metres = param(0.05, ge=0.01, le=0.3, doc="height by which the item is lifted")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time between motion and measurement")
    period: Seconds = param(0.25, ge=0.05, le=10, doc="time over which the load is averaged")
    reasons = ("unreachable", "blocked", "dropped", "implausible", "contradicted", "no_bin")
    uses = ("arm", "tool")
    senses = True
    moves = True
    tool_state = (HOLDING, HOLDING)
    tool_state_after_failure = {"dropped": EMPTY, "halt": ANY}
    waits = "period"

    def run(self, cell: Cell) -> Steps:
        """Lift the item, average the load of the tool at rest, and record the weight."""
        x, y, z = map(float, cell.arm.tool_pose.position)
        yield from transport(self, cell, self.held, Goal((x, y, z + self.height)), "the weighing")
        yield from cell.clock.sleep(self.settle)
        loads: list[float] = []
        for _ in cell.clock.sleep(self.period):
            loads.append(cell.tool.load)
            yield
        fail_if_dropped(self, cell, self.held, "during the weighing")
        self.weight = sum(loads) / len(loads) - cell.ledger.empty_load
        if not math.isfinite(self.weight):
            raise self.failure("implausible", f"the load cell is broken: the mean load is {self.weight} N")
        if len(set(loads)) == 1:
            readings = f"{loads[0]:.3f} N in {len(loads)} readings"
            raise self.failure("implausible", f"the load cell is broken: it reads exactly {readings}")
        if contradiction := cell.ledger.record_weight(self.held, self.weight, cell.tool.load_std):
            raise self.failure("contradicted", f"the class of {self.held} is uncertain: {contradiction}")
        self.bin = choose_bin(cell, self.held)
        if not self.bin:
            label = cell.ledger.get_label(self.held)
            explanation = cell.ledger.explain_skipped_class(label) or "no bin is free"
            raise self.failure("no_bin", f"{self.held} is a {label}: {explanation}")
