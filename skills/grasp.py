"""Skill that grasps the object that the tool touches."""

from __future__ import annotations

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.cell.tools import ToolMeasurement
from executive.manipulation.grasps import measure_held_pose
from executive.manipulation.motions import wait_for_fingers
from executive.skill import EMPTY, HOLDING, In, Out, Seconds, Skill, param, port

PRESSING_TIME = 0.1
"""Time in which fingers at rest that hold no object yet may still begin to press [s]."""
MAX_FALSE_GRASPS = 3
"""Number of contradicted grasps in a row after which the sensor of the tool is no longer believed."""


class Grasp(Skill):
    """Close the tool on the target and verify the grasp.

    The skill succeeds if the tool's sensor reports an object after the time `settle`; fingers must then rest
    as far apart as for the class. It fails with `sensor_implausible` if this sensor cannot be right.
    """

    target: In[Target] = port(doc="the target that the tool touches")
    held: Out[Item] = port(refers_to="item", doc="the item in the tool")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time to wait before reading the sensor")
    reasons = ("missed", "sensor_implausible")
    uses = ("tool",)
    tool_state = (EMPTY, HOLDING)
    waits = "settle"

    def run(self, cell: Cell) -> Steps:
        """Close the tool, wait, and read its sensor, unless the sensor is wrong already before."""
        noun = cell.tool_model.noun
        if cell.tool.holding:
            message = f"the sensor reports a {noun} while the tool is open; repair the sensor of the tool"
            raise self.failure("sensor_implausible", message)
        if (count := cell.ledger.false_grasp_count) >= MAX_FALSE_GRASPS:
            message = f"load or looks contradicted the sensor of the {noun} {count} times in a row"
            raise self.failure("sensor_implausible", f"{message}; check this sensor and the load cell")
        cell.tool.close()
        is_gripping = False
        is_holding = False
        measurement = ToolMeasurement()
        try:
            yield from cell.clock.sleep(self.settle)
            yield from wait_for_fingers(cell)
            if cell.tool_model.max_opening and not cell.tool.holding:
                # Slow fingers press only some time after an object has stopped them.
                yield from cell.clock.sleep(PRESSING_TIME)
            is_gripping = cell.tool.holding
            if cell.tool_model.max_opening:
                measurement = cell.tool_model.measure_grip(cell.classes[self.target.label], cell.tool.opening)
            is_holding = is_gripping and not measurement.is_miss
            if is_holding and cell.tool_model.max_opening:
                is_holding = cell.ledger.record_measurement(self.target.item, measurement)
        finally:
            # A halted skill must not leave an object in the tool, because the ledger has recorded no grasp.
            if not is_holding:
                cell.tool.open()
        if not is_holding:
            cell.ledger.record_failed_pick(self.target.item)
            message = f"no {noun} on {self.target.item} {self.settle:.2f} s after contact"
            if is_gripping and measurement.contradiction:
                message = f"{self.target.item} may be no {self.target.label}: {measurement.contradiction}"
            if not cell.ledger.is_tool_plausible:
                message = f"{message}, and no pick has succeeded; check the tool and its sensor"
                raise self.failure("sensor_implausible", message)
            raise self.failure("missed", message)
        cell.ledger.record_grasp(self.target.item, measure_held_pose(cell, self.target))
        self.held = self.target.item
