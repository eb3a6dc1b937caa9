"""Disturbances of a cell that make a skill fail with a given reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.cell.config import TableConfig
from executive.skill import Skill
from executive.testing import faults as effects
from executive.testing.faults.effect import Effect


@dataclass(frozen=True)
class Cause:
    """A disturbance that makes skills fail with a reason.

    Attributes:
        effect: Effect of the disturbance.
        means: Description of the effect.
        needs: Property of the skills that it affects: `moves`, `senses`, or the name of a part that they use;
        ""
            for all skills.
        lasts: True if it may last until the end; False: a campaign limits the number of activations.
    """

    effect: Effect
    means: str
    needs: str = ""
    lasts: bool = True

    def can(self, skill: type[Skill]) -> bool:
        """Return True if the disturbance affects a skill."""
        does = {"": True, "moves": skill.moves, "senses": skill.senses}
        return does.get(self.needs, self.needs in skill.uses)


def causes(table: TableConfig) -> Mapping[str, Cause]:
    """Return the known causes of failures by the name of the reason."""
    aside = effects.object_bumped(table.x, table.y)
    return {
        "missed": Cause(effects.seal_fails(), "nothing seals", "tool"),
        "dropped": Cause(effects.seal_breaks(), "the seal breaks half-way", "moves"),
        "no_contact": Cause(aside, "the object is bumped aside", "moves"),
        "blocked": Cause(effects.arm_runs_into(), "the arm runs into something", "moves"),
        "unreachable": Cause(effects.no_way(), "the planner finds no way", "moves"),
        "stuck": Cause(effects.tool_sticks(), "the tool does not let go", "tool"),
        "unavailable": Cause(effects.detector_dead(), "the detector is dead", "camera"),
        "unsure": Cause(effects.detector_unsure(), "the detector is sure of nothing", "camera"),
        "hidden": Cause(effects.workspace_hidden(), "the arm hides the workspace", "camera"),
        "stale": Cause(effects.table_bumped(), "something bumps the table", lasts=False),
        "no_depth": Cause(effects.no_depth(), "no detection can be localized"),
        "quit": Cause(effects.operator_quits(), "the operator quits", "senses"),
        "rescan": Cause(effects.operator_asks_rescan(), "the operator wants a look", "senses", lasts=False),
    }
