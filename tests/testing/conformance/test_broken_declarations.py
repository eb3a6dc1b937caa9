"""What a skill declares wrongly is found, and told word for word."""

from __future__ import annotations

import broken_declarations as broken
import pytest
from verdicts import Said, failures, problems

from executive.skill import Skill

BROKEN: list[tuple[type[Skill], Said]] = [
    (broken.Mute, {"class_documented": (
        "Mute has no docstring. Say in a sentence what is true when it has succeeded."
    )}),
    (broken.Terse, {"class_documented": (
        'the docstring of Terse begins with "waits", which is no sentence. '
        "End the first line with a full stop."
    )}),
    (broken.Undescribed, {"settings_documented": (
        'Undescribed.gap has no doc. Write param(..., doc="what it is").'
    )}),
    (broken.Unitless, {"numbers_have_units": (
        "Unitless.force is a float without a unit. Declare it as Seconds, Metres or "
        'Annotated[float, "N"]; if it is a ratio, write [-] into its doc.'
    )}),
    (broken.OutOfBounds, {"defaults_allowed": (
        "OutOfBounds.gap has the default 0.3, which is more than 0.2. "
        "Mend the default, or what it is checked against."
    )}),
    (broken.Unsayable, {"defaults_allowed": (
        "Unsayable.speed is a Speed, which no mission can say. "
        "Declare a text with choices, a number or a list of them."
    )}),
    (broken.Shouting, {"reasons_declared": (
        'Shouting declares the reason "tooTired". Call it by a lower_snake word other than "halt".'
    )}),
    (broken.Lying, {"reasons_declared": (
        'broken_declarations.py:{line} fails with "no_bins", which Lying does not declare. '
        "Add it to reasons; there are: tired."
    )}),
    (broken.Gripping, {"resources_declared": (
        'Gripping uses "gripper", which no cell has. There are: arm, tool, camera.'
    )}),
    (broken.Floating, {
        "resources_declared": (
            'Floating moves the arm but does not use it. Add "arm" to uses, or leave moves out.'
        ),
        "moves_if_it_says_so": (
            "Floating says that it moves, and succeeds without starting the arm in any situation. "
            'Write "yield from" before follow or carry of executive.moving, leave moves out, or arrange a '
            "stage on which it moves: conformance(Floating, lambda stage: ...), as skills/README.md shows."
        ),
    }),
    (broken.Confused, {"tool_declared": (
        'Confused.tool_left tells of "dropped", which is no ending of it. There are: tired, halt.'
    )}),
    (broken.Boundless, {"mistakes_refused": (
        "the mission loader takes {'no': 'value'} for Boundless.extra, a value of a wrong type. "
        "Declare the param's type, bounds and choices as narrow as they are."
    )}),
    (broken.Unordered, {"mistakes_refused": (
        "what a mission says to Unordered cannot be checked: "
        "TypeError: unsupported operand type(s) for -: 'str' and 'int'. "
        "Declare params of plain types, with bounds and choices that their values can be compared with."
    )}),
    (broken.Lenient, {"unknown_keywords_refused": (
        "Lenient(no_such_setting=1) is taken. "
        "Leave the constructor to Skill; what it needs is declared by param, In and Out."
    )}),
    (broken.Grumpy, {"unknown_keywords_refused": (
        'Grumpy(no_such_setting=1) is refused without naming it: "no". '
        "Leave the constructor to Skill; what it needs is declared by param, In and Out."
    )}),
]  # fmt: skip
"""Skills, and what is said of them first, by the name of every check that fails."""

EVERYTHING: list[tuple[type[Skill], str, list[str]]] = [
    (broken.Undescribed, "settings_documented", [
        'Undescribed.gap has no doc. Write param(..., doc="what it is").',
        'Undescribed.target has no doc. Write port(..., doc="what it is").',
    ]),
    (broken.Shouting, "reasons_declared", [
        'Shouting declares the reason "tooTired". Call it by a lower_snake word other than "halt".',
        'Shouting declares the reason "halt". Call it by a lower_snake word other than "halt".',
        'Shouting declares the reason "lost" twice. Leave one out.',
    ]),
    (broken.Texts, "reasons_declared", ['Texts.reasons is the text "tired". Write a tuple: ("tired",).']),
    (broken.Texts, "resources_declared", ['Texts.uses is the text "arm". Write a tuple: ("arm",).']),
    (broken.Texts, "tool_declared", [
        "Texts.tool_state is 'empty'. Write two of ANY, EMPTY and HOLDING: before and after.",
    ]),
    (broken.Texts, "arranged", [
        "Texts cannot be tried: its tool_state begins with 'e'; it must say ANY, EMPTY or HOLDING",
    ]),
    (broken.Single, "tool_declared", [
        "Single.tool_state is <ToolState.EMPTY: 'empty'>. Write two of ANY, EMPTY and HOLDING: "
        "before and after.",
    ]),
    (broken.Single, "arranged", [
        "Single cannot be tried: its tool_state is <ToolState.EMPTY: 'empty'>; "
        "it must say what it needs and leaves",
    ]),
    (broken.Confused, "tool_declared", [
        'Confused.tool_left tells of "dropped", which is no ending of it. There are: tired, halt.',
        'Confused.tool_left["tired"] is False. Write ANY, EMPTY or HOLDING.',
    ]),
    (broken.Choosy, "defaults_allowed", [
        "Choosy.order has the default 'rows', which is not among 'columns', 'none'. "
        "Mend the default, or what it is checked against.",
        "Choosy.gap has the default 'far': must be a number, not the text \"far\". "
        "Mend the default, or what it is checked against.",
        "Choosy.near has the default 0.1, which is less than 0.2. "
        "Mend the default, or what it is checked against.",
    ]),
]  # fmt: skip
"""Skills, a check, and everything that it says."""


@pytest.mark.parametrize(("skill", "said"), BROKEN, ids=lambda value: getattr(value, "__name__", ""))
def test_a_broken_rule_is_found_and_nothing_else(skill: type[Skill], said: Said) -> None:
    assert failures(skill) == said


@pytest.mark.parametrize(("skill", "check", "told"), EVERYTHING)
def test_everything_that_breaks_a_rule_is_told(skill: type[Skill], check: str, told: list[str]) -> None:
    assert problems(skill, check) == told
