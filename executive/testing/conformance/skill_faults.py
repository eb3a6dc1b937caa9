"""Faults that the conformance checks inject into test runs of a skill, one fault per run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from executive.cells.fake.arm import FakeMotion
from executive.skill import Skill
from executive.testing import faults
from executive.testing.faults.effect import Effect, Occurrence

RUN_INTERVALS = 20
"""Number of equal intervals of a run; the seal breaks at each boundary, in a test run of its own."""
PRECEDING_MOTION_STEPS = 24
"""Duration of a motion that is still in progress when the skill starts [control steps]."""


@dataclass(frozen=True)
class NamedFault:
    """A fault of the cell in a test run of a skill.

    Attributes:
        name: Description, as a part of a sentence: `while the table is empty`.
        effect: Effect of the fault on the cell.
        resource: Resource that affected skills use: `arm`, `tool` or `camera`; "" if all skills are affected.
        requires_holding: True if the fault affects only runs with an object in the tool at the start.
        tick: Control step before which the fault begins.
    """

    name: str
    effect: Effect
    resource: str = ""
    requires_holding: bool = False
    tick: int = 0


def list_skill_faults(skill: type[Skill], ticks: int, *, is_holding: bool) -> Iterator[NamedFault]:
    """Yield the faults for a skill whose run without a fault has `ticks` control steps.

    Faults that need an object in the tool at the start are yielded only if `is_holding` is True.
    """
    for fault in _FAULTS:
        can_occur = is_holding or not fault.requires_holding
        if can_occur and (not fault.resource or fault.resource in skill.uses):
            yield fault
    if "tool" in skill.uses:
        break_ticks = {round(ticks * index / RUN_INTERVALS) for index in range(RUN_INTERVALS + 1)}
        for tick in sorted(break_ticks):
            yield NamedFault(f"while the seal breaks at tick {tick}", faults.seal_breaks(None), tick=tick)


def _move_arm(occurrence: Occurrence) -> bool:
    """Start a motion of the arm, as a preceding skill could have done."""
    arm = occurrence.context.cell.arm
    arm.start(FakeMotion([arm.tool_pose] * PRECEDING_MOTION_STEPS))
    return True


def _empty_table(occurrence: Occurrence) -> bool:
    """Remove all objects from the table; return False, so that also later objects are removed."""
    context = occurrence.context
    while (true_object := context.find_object("nearest", "")) is not None:
        context.world.remove(true_object)
    return False


_FAULTS = (
    NamedFault("while the suction cup cannot seal", faults.seal_fails(), "tool"),
    NamedFault("while the tool sticks", faults.tool_sticks(), "tool", requires_holding=True),
    NamedFault("while the table is empty", Effect("table_empty", _empty_table)),
    NamedFault("while the table has changed since the last image", faults.table_bumped()),
    NamedFault("while the arm collides", faults.arm_collides(), "arm"),
    NamedFault("while the arm still moves at the start", Effect("arm_moves", _move_arm), "arm"),
    NamedFault("while the goal is unreachable", faults.no_path(), "arm"),
    NamedFault("while every path is blocked", faults.no_path(is_blocked=True), "arm"),
    NamedFault("while the arm occludes the table", faults.workspace_occluded()),
    NamedFault("while no depth is measured", faults.no_depth()),
    NamedFault("while no detector answers", faults.detector_dead()),
    NamedFault("while the detectors detect nothing", faults.detector_blind()),
    NamedFault("while all confidences are low", faults.detector_unsure()),
    NamedFault("while the operator quits", faults.operator_quits()),
    NamedFault("while the operator requests a new scan", faults.operator_asks_rescan()),
)
"""Faults that begin at the start of a run."""
