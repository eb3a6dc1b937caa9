"""Run one skill by itself, without a tree."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from executive.skill import Direction, Skill, SkillFailed
from executive.workcell import Workcell


@dataclass(frozen=True)
class SkillResult:
    """How a skill ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, or `RUNNING` if it was still running after `ticks`.
        reason: The declared reason of a failure, or "".
        message: Its sentence, or "".
        outputs: Values of the output ports, on success.
        ticks: Control steps it took.
    """

    status: str
    reason: str = ""
    message: str = ""
    outputs: dict[str, Any] = field(default_factory=dict)
    ticks: int = 0


def run_skill(
    skill: Skill, workcell: Workcell, *, ticks: int = 20_000, halt_at: int | None = None
) -> SkillResult:
    """Tick `skill` on `workcell` until it ends, is halted at tick `halt_at`, or `ticks` have passed.

    Exceptions that are no declared failure come out as they are: in a mission they would be faults.
    """
    steps = skill.run(workcell.cell)
    for tick in range(ticks):
        if tick == halt_at:
            steps.close()  # type: ignore[attr-defined]
            return SkillResult("HALTED", ticks=tick)
        try:
            next(steps)
        except StopIteration:
            outputs = {
                name: getattr(skill, name)
                for name, port in skill.ports.items()
                if port.direction is Direction.OUT
            }
            return SkillResult("SUCCESS", outputs=outputs, ticks=tick)
        except SkillFailed as failure:
            return SkillResult("FAILURE", failure.reason, failure.message, ticks=tick)
        workcell.advance()
    return SkillResult("RUNNING", ticks=ticks)
