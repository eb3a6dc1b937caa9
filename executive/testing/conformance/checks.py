"""Everything that is true of a skill that conforms; one function per check."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.skill import Skill
from executive.testing.conformance import conduct, declarations, dropped, effects, endings, halting, refusals
from executive.testing.conformance.case import Case
from executive.testing.conformance.check import Check, Rule
from executive.testing.conformance.situations import Arrange
from executive.testing.conformance.stage import Stage

RULES: tuple[Rule, ...] = (
    declarations.named_for_missions,
    declarations.class_documented,
    declarations.settings_documented,
    declarations.numbers_have_units,
    declarations.defaults_allowed,
    declarations.reasons_declared,
    declarations.resources_declared,
    declarations.tool_declared,
    declarations.imports_allowed,
    dropped.calls_take_effect,
    refusals.mistakes_refused,
    refusals.unknown_keywords_refused,
    endings.arranged,
    conduct.ticks_come_back,
    endings.hands_back_steps,
    endings.comes_to_an_end,
    endings.ends_as_declared,
    endings.adversity_ends_as_declared,
    endings.succeeds_somewhere,
    endings.tool_left_as_declared,
    endings.rests_at_the_end,
    halting.halts_at_once,
    halting.halts_at_rest,
    halting.halts_with_tool_as_declared,
    effects.outputs_set,
    effects.outputs_fit,
    effects.writes_only_outputs,
    effects.inputs_unchanged,
    effects.uses_only_what_it_declares,
    effects.moves_if_it_says_so,
    conduct.repeats_itself,
    conduct.ticks_are_quick,
    conduct.never_sooner_than_shortest,
    conduct.keeps_to_the_clock,
    conduct.leaves_nothing_open,
)


def nothing_to_add(stage: Stage) -> Mapping[str, Any]:
    """Leave the stage as it is, and everything that a skill needs to be made up."""
    del stage
    return {}


def conformance(skill: type[Skill], arrange: Arrange = nothing_to_add, name: str = "") -> list[Check]:
    """Return every check of a skill, to be called one by one; nothing is run before.

    Args:
        skill: Its class.
        arrange: Is given a `Stage` for every situation, may change it, and returns values for those params
            and inputs that cannot be made up, or should be others.
        name: What the skill is installed as; by default what its class is called.
    """
    case = Case(name or skill.__name__, skill, arrange)
    return [Check(case, rule) for rule in RULES]
