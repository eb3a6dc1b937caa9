"""Faults under which a skill is tried, one at a time, in each situation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from executive.cells.fake.arm import FakeMotion
from executive.skill import Skill
from executive.testing import faults
from executive.testing.faults.effect import Effect, Occurrence

SEAL_BREAKS = 20
"""Number of intervals between the evenly spaced ticks at which the seal breaks."""
MOTION_STEPS = 24
"""Number of control steps of the motion at the start."""
MAX_OBJECTS = 10
"""Maximum number of objects that are removed from the table."""


@dataclass(frozen=True)
class NamedFault:
    """A fault of the cell in a run of a skill.

    Attributes:
        name: Description that continues a sentence: `while nothing seals`.
        effect: The effect.
        uses: Part whose users are affected; "" for all skills.
        holding: True if the fault affects only runs with an object in the tool at the start.
        times: Number of simultaneous occurrences.
        tick: Control step before which the fault begins.
    """

    name: str
    effect: Effect
    uses: str = ""
    holding: bool = False
    times: int = 1
    tick: int = 0


def list_skill_faults(skill: type[Skill], ticks: int, *, holding: bool) -> Iterator[NamedFault]:
    """Yield the faults for a skill that takes `ticks` control steps without a fault."""
    for fault in _FAULTS:
        if (not fault.uses or fault.uses in skill.uses) and holding >= fault.holding:
            yield fault
    if "tool" in skill.uses:
        for tick in sorted({round(ticks * index / SEAL_BREAKS) for index in range(SEAL_BREAKS + 1)}):
            yield NamedFault(f"while the seal breaks at tick {tick}", faults.seal_breaks(None), tick=tick)


def _move_arm(occurrence: Occurrence) -> bool:
    """Start a motion, like a preceding skill."""
    arm = occurrence.scene.cell.arm
    arm.start(FakeMotion([arm.tool_pose] * MOTION_STEPS))
    return True


_FAULTS = (
    NamedFault("while nothing seals", faults.seal_fails(), "tool"),
    NamedFault("while the tool sticks", faults.tool_sticks(), "tool", holding=True),
    NamedFault("while the table is empty", faults.object_removed("nearest"), times=MAX_OBJECTS),
    NamedFault("while the table has changed since the look", faults.table_bumped()),
    NamedFault("while the arm runs into something", faults.arm_runs_into(), "arm"),
    NamedFault("while the arm still moves at the start", Effect("arm_moves", _move_arm), "arm"),
    NamedFault("while no plan reaches the goal", faults.no_way(), "arm"),
    NamedFault("while every path is blocked", faults.no_way(is_blocked=True), "arm"),
    NamedFault("while the arm hides the table", faults.workspace_hidden()),
    NamedFault("while the depth is missing", faults.no_depth()),
    NamedFault("while no detector answers", faults.detector_dead()),
    NamedFault("while the detectors see nothing", faults.detector_blind()),
    NamedFault("while the detectors are unsure", faults.detector_unsure()),
    NamedFault("while the operator quits", faults.operator_quits()),
    NamedFault("while the operator requests a new look", faults.operator_asks_rescan()),
)
