"""A call that does nothing is found where it stands, and told word for word."""

from __future__ import annotations

from typing import TYPE_CHECKING

import broken_calls as broken
import pytest
from conforming_skills import Careful
from verdicts import Said, failures

from executive.skill import Skill
from executive.testing.conformance.reach import makes_failure, makes_steps

if TYPE_CHECKING:
    from executive.cell import Cell, Steps
    from executive.skill import SkillFailed


def unmade(text: str) -> str:
    return (
        f"broken_calls.py:{{line}} calls {text}(...) and makes none of its steps, so it does nothing. "
        f'Write "yield from {text}(...)".'
    )


def unraised(text: str) -> str:
    return (
        f"broken_calls.py:{{line}} calls {text}(...) and does not raise it, so nothing fails. "
        f'Write "raise {text}(...)".'
    )


def unmoved(name: str) -> str:
    return (
        f"{name} says that it moves, and succeeds without starting the arm in any situation. "
        'Write "yield from" before follow or carry of executive.moving, leave moves out, or arrange a stage '
        f"on which it moves: conformance({name}, lambda stage: ...), as skills/README.md shows."
    )


BROKEN: list[tuple[type[Skill], Said]] = [
    (broken.Idle, {"calls_take_effect": unmade("follow"), "moves_if_it_says_so": unmoved("Idle")}),
    (broken.Nodding, {
        "calls_take_effect": unmade("moving.follow"), "moves_if_it_says_so": unmoved("Nodding"),
    }),
    (broken.Returning, {"calls_take_effect": unmade("follow"), "moves_if_it_says_so": unmoved("Returning")}),
    (broken.Keeping, {"calls_take_effect": unmade("follow"), "moves_if_it_says_so": unmoved("Keeping")}),
    (broken.Sleepless, {"calls_take_effect": unmade("cell.clock.sleep")}),
    (broken.Impatient, {"calls_take_effect": unmade("self._rest")}),
    (broken.Timid, {"calls_take_effect": unraised("self.failed")}),
    (broken.Whispering, {"calls_take_effect": unraised("self._give_up")}),
    (broken.Still, {"moves_if_it_says_so": unmoved("Still")}),
]  # fmt: skip
"""Skills, and what is said of them first, by the name of every check that fails."""


@pytest.mark.parametrize(("skill", "said"), BROKEN, ids=lambda value: getattr(value, "__name__", ""))
def test_a_call_that_does_nothing_is_found_and_nothing_else(skill: type[Skill], said: Said) -> None:
    assert failures(skill) == said


def test_what_is_kept_and_used_later_is_not_dropped() -> None:
    assert failures(Careful) == {}


def test_what_is_imported_for_type_checkers_alone_is_known_by_its_name() -> None:
    def rest(cell: Cell) -> Steps:
        return cell.clock.sleep(1.0)

    def tire(skill: Skill) -> SkillFailed:
        return skill.failed("tired", "after 1 step")

    assert (makes_steps(rest), makes_failure(rest)) == (True, False)
    assert (makes_steps(tire), makes_failure(tire)) == (False, True)
