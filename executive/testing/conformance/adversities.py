"""Adversities of a cell: one disturbance at a time, for every run of a skill but the plain ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from executive.cells.fake.arm import FakeMotion
from executive.skill import Skill
from executive.testing import faults as effects
from executive.testing.faults.effect import Effect, Occasion

SEAL_BREAKS = 20
"""Number of moments, spread over a run, at which the seal breaks."""
BRAKING_STEPS = 24
"""Control steps for which the arm still moves at the start."""
MAX_OBJECTS = 10
"""Number of objects that are taken off the table."""


@dataclass(frozen=True)
class ArmMoves(Effect):
    """The arm still moves: another skill used it before."""

    name = "arm_moves"

    def act(self, now: Occasion) -> bool:
        """Start a motion."""
        arm = now.scene.cell.arm
        arm.start(FakeMotion([arm.tool_pose] * BRAKING_STEPS))
        return True


@dataclass(frozen=True)
class Adversity:
    """Something that goes wrong in a run.

    Attributes:
        name: Its name, for a sentence: `while nothing seals`.
        effect: The disturbance.
        uses: Part that a skill must use for it to matter; "" for any skill.
        holding: It matters only where the tool holds something at the start.
        times: Number of times that it happens at once.
        tick: Control step before which it begins.
    """

    name: str
    effect: Effect
    uses: str = ""
    holding: bool = False
    times: int = 1
    tick: int = 0


def adversities(skill: type[Skill], ticks: int, *, holding: bool) -> Iterator[Adversity]:
    """Yield the adversities of a skill that takes `ticks` control steps where nothing goes wrong."""
    for adversity in _ADVERSITIES:
        if (not adversity.uses or adversity.uses in skill.uses) and holding >= adversity.holding:
            yield adversity
    if "tool" in skill.uses:
        for tick in sorted({round(ticks * part / SEAL_BREAKS) for part in range(SEAL_BREAKS + 1)}):
            breaks = effects.seal_breaks(None)
            yield Adversity(f"while the seal breaks at tick {tick}", breaks, tick=tick)


_ADVERSITIES = (
    Adversity("while nothing seals", effects.seal_fails(), "tool"),
    Adversity("while what the tool holds does not come off", effects.tool_sticks(), "tool", holding=True),
    Adversity("while everything on the table is gone", effects.object_removed("nearest"), times=MAX_OBJECTS),
    Adversity("while the table has changed since the look", effects.table_bumped()),
    Adversity("while the arm runs into something", effects.arm_runs_into(), "arm"),
    Adversity("while the arm still moves at the start", ArmMoves(), "arm"),
    Adversity("while no plan reaches the goal", effects.no_way(), "arm"),
    Adversity("while every way is blocked", effects.no_way(is_blocked=True), "arm"),
    Adversity("while the arm hides the table", effects.workspace_hidden()),
    Adversity("while no depth is seen", effects.no_depth()),
    Adversity("while no detector answers", effects.detector_dead()),
    Adversity("while the detectors see nothing", effects.detector_blind()),
    Adversity("while the detectors are unsure", effects.detector_unsure()),
    Adversity("while the operator quits", effects.operator_quits()),
    Adversity("while the operator wants a fresh look", effects.operator_asks_rescan()),
)
