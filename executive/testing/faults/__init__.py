"""Fault scripts: faults of the cell of a mission or a skill, and their times.

A script is a list of faults, for `run_mission(faults=[...])`:

* The second grasp fails: `during("*/Grasp", seal_fails(), nth=2)`
* The detector hangs from 4 s to 9 s: `between(4.0, 9.0, detector_hangs())`
* An object is removed at 12 s: `after(12.0, object_removed("nearest"))`
* Each transit drops its object with probability 0.1:
  `with_probability(0.1, "*/Transit", seal_breaks(), seed=1)`
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
