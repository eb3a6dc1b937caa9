"""Fault scripts: lists of scheduled faults of a cell, which tests inject into runs.

Examples of faults in a script for `run_mission(faults=[...])`:

* The second grasp fails: `during("*/Grasp", seal_fails(), activations=2)`
* The detector does not answer from 4 s to 9 s: `between(4.0, 9.0, detector_hangs())`
* The object nearest to the tool is removed at 12 s: `after(12.0, object_removed("nearest"))`
* In each transit the seal breaks with probability 0.1:
  `with_probability(0.1, "*/Transit", seal_breaks(), seed=1)`
"""

from executive.testing.faults.detector_faults import (
    detector_dead,
    detector_finds_nothing,
    detector_hangs,
    detector_slow,
    detector_times_out,
    detector_unsure,
)
from executive.testing.faults.faulty_cell import FaultyCell, with_faults
from executive.testing.faults.object_faults import (
    object_bumped,
    object_moved,
    object_removed,
    object_unsealable,
)
from executive.testing.faults.robot_faults import (
    arm_collides,
    no_depth,
    no_path,
    operator_asks_rescan,
    operator_quits,
    seal_breaks,
    seal_breaks_over_wrong_bin,
    seal_fails,
    table_bumped,
    tool_does_not_release,
    workspace_occluded,
)
from executive.testing.faults.script import ScheduledFault, after, between, during, with_probability

__all__ = [
    "FaultyCell", "ScheduledFault", "after", "arm_collides", "between", "detector_dead",
    "detector_finds_nothing", "detector_hangs", "detector_slow", "detector_times_out", "detector_unsure",
    "during", "no_depth", "no_path", "object_bumped", "object_moved", "object_removed", "object_unsealable",
    "operator_asks_rescan", "operator_quits", "seal_breaks", "seal_breaks_over_wrong_bin", "seal_fails",
    "table_bumped", "tool_does_not_release", "with_faults", "with_probability", "workspace_occluded",
]  # fmt: skip
