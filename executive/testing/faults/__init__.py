"""Fault scripts: faults of a cell in which a mission or a skill runs, and when they happen.

A script is a list of faults, for `run_mission(faults=[...])`:

* the second grasp slips: `during("*/Grasp", seal_fails(), nth=2)`
* no answer from 4 s to 9 s: `between(4.0, 9.0, detector_hangs())`
* at 12 s somebody takes an object away: `after(12.0, object_removed("nearest"))`
* now and then something falls: `with_probability(0.1, "*/Transit", seal_breaks(), seed=1)`
"""

from executive.testing.faults.detector import (
    detector_blind,
    detector_dead,
    detector_given_up,
    detector_hangs,
    detector_slow,
    detector_unsure,
)
from executive.testing.faults.faulty_cell import FaultyCell, with_faults
from executive.testing.faults.objects import object_bumped, object_moved, object_refuses, object_removed
from executive.testing.faults.robot import (
    arm_runs_into,
    no_depth,
    no_way,
    operator_asks_rescan,
    operator_quits,
    seal_breaks,
    seal_breaks_over_wrong_bin,
    seal_fails,
    table_bumped,
    tool_sticks,
    workspace_hidden,
)
from executive.testing.faults.script import ScheduledFault, after, between, during, with_probability

__all__ = [
    "FaultyCell", "ScheduledFault", "after", "arm_runs_into", "between", "detector_blind",
    "detector_dead", "detector_given_up", "detector_hangs", "detector_slow", "detector_unsure", "during",
    "no_depth", "no_way", "object_bumped", "object_moved", "object_refuses", "object_removed",
    "operator_asks_rescan", "operator_quits", "seal_breaks", "seal_breaks_over_wrong_bin", "seal_fails",
    "table_bumped", "tool_sticks", "with_faults", "with_probability", "workspace_hidden",
]  # fmt: skip
