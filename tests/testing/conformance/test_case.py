"""A skill is halted at every tick, or at those that count."""

from __future__ import annotations

from itertools import count, pairwise
from typing import ClassVar

import pytest
from broken_endings import Endless
from conforming_skills import Push

from executive.cell import Cell, Steps
from executive.skill import EMPTY, Skill
from executive.testing.conformance.case import BUDGET, Case
from executive.testing.conformance.checks import nothing_to_add


class Patient(Skill):
    """Wait for long, and ask a question in between."""

    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Wait."""
        for step in range(1200):
            if step == 601:
                cell.camera.area("table")
            yield


def case(skill: type[Skill]) -> Case:
    return Case(skill.__name__, skill, nothing_to_add)


def test_a_short_skill_is_halted_at_every_tick() -> None:
    pushing = case(Push)
    (plain,) = pushing.plain
    assert [rehearsal.ticks for rehearsal in pushing.halted] == list(range(1, plain.ticks + 1))


def test_a_long_skill_is_halted_where_it_does_something_and_now_and_then() -> None:
    patient = case(Patient)
    ticks = [rehearsal.ticks for rehearsal in patient.halted]
    assert sum(ticks) < 1.2 * BUDGET
    assert {1, 601, 602, 1200} <= set(ticks)
    assert max(later - earlier for earlier, later in pairwise(ticks)) < 10


def test_what_never_ends_is_not_tried_under_everything_that_may_go_wrong() -> None:
    endless = case(Endless)
    assert [rehearsal.ending.status for rehearsal in endless.plain] == ["RUNNING", "RUNNING"]
    assert endless.hard == []


def test_runs_that_are_kept_by_the_hundred_keep_no_arguments() -> None:
    pushing = case(Push)
    assert any(call.arguments for rehearsal in pushing.plain for call in rehearsal.calls)
    assert not any(call.arguments for rehearsal in pushing.halted for call in rehearsal.calls)


@pytest.mark.parametrize(("looks", "found"), [({8}, False), ({8, 10}, True), ({2}, True)])
def test_what_is_opened_once_by_the_way_is_not_the_skills_but_for_its_first_run(
    monkeypatch: pytest.MonkeyPatch, looks: set[int], found: bool
) -> None:
    number = count(1)
    monkeypatch.setattr(
        "executive.testing.conformance.rehearsal.open_things",
        lambda: {"the open file socket (number 9)"} if next(number) in looks else set(),
    )
    pushing = case(Push)
    assert any(rehearsal.left for rehearsal in (*pushing.plain, *pushing.halted)) == found
