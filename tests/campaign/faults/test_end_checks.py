"""Every check of a halt finds what it is there for, and nothing in a halt that was as it has to be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from events import at, item_changed

from executive.campaign.faults.trial_checks import check_arm_at_rest, check_held_item, check_journal
from executive.cells.fake.arm import FakeMotion
from executive.cells.fake.cell import FakeCell
from executive.events import NodeEnded, NodeStarted, RunEnded, TimedEvent

HALTED = RunEnded("HALTED", "halted", "halted by the user", "", False, "", 40, 0.166667)


def journal_of(*statuses: tuple[str, str], end: RunEnded = HALTED) -> list[TimedEvent]:
    """Return a journal of these nodes and statuses, one per tick, and an end."""
    events = [
        at(tick, NodeStarted(node) if status == "RUNNING" else NodeEnded(node, status))
        for tick, (node, status) in enumerate(statuses)
    ]
    return [*events, at(40, end)]


def test_a_moving_arm_is_reported(fake: FakeCell) -> None:
    assert list(check_arm_at_rest(fake)) == []
    fake.arm.start(FakeMotion(np.tile(fake.arm.q, (1000, 1))))
    found = list(check_arm_at_rest(fake))
    assert found[0] == "the arm is not at rest"


@pytest.mark.parametrize(
    ("statuses", "problems"),
    [
        ([("a", "RUNNING"), ("b", "RUNNING"), ("b", "SUCCESS"), ("b", "RUNNING"), ("b", "INVALID"),
          ("a", "INVALID")], []),
        ([("a", "RUNNING"), ("b", "RUNNING"), ("b", "INVALID")],
         ["in the journal a starts at tick 0 and does not end"]),
        ([("a", "RUNNING"), ("a", "RUNNING"), ("a", "INVALID")],
         ["in the journal a starts at tick 1, but it is running already"]),
    ],
)  # fmt: skip
def test_every_node_of_a_journal_begins_once_and_ends(
    statuses: list[tuple[str, str]], problems: list[str]
) -> None:
    assert list(check_journal(journal_of(*statuses), HALTED)) == problems


@pytest.mark.parametrize(
    "journal", [[], [*journal_of(), *journal_of()], [*journal_of(), at(41, item_changed("cube-1"))]]
)
def test_a_journal_without_exactly_one_end_is_reported(journal: list[TimedEvent]) -> None:
    (problem,) = check_journal(journal, HALTED)
    ends = sum(isinstance(timed.event, RunEnded) for timed in journal)
    assert problem == f"the journal has {ends} RunEnded in {len(journal)} events; only the last must be one"


def test_a_journal_with_another_end_than_the_run_is_reported() -> None:
    (problem,) = check_journal(journal_of(end=replace(HALTED, held_item="cube_1")), HALTED)
    assert problem.startswith("the journal ends with RunEnded(status='HALTED'")


@pytest.mark.parametrize(
    ("holding", "statuses", "problem"),
    [
        (True, "cube_1", []),
        (False, "", []),
        (True, "", ['the tool holds an object, but the held item of the run is ""']),
        (True, "something", ['the tool holds an object, but the held item of the run is "something"']),
        (False, "cube_1", ['the tool is empty, but the held item of the run is "cube_1"']),
    ],
)
def test_the_held_item_must_be_named(holding: bool, statuses: str, problem: list[str]) -> None:
    workcell: Any = SimpleNamespace(
        cell=SimpleNamespace(tool=SimpleNamespace(holding=holding)),
        accounts=SimpleNamespace(list_items=lambda: [item_changed("cube_1")]),
    )
    assert list(check_held_item(replace(HALTED, held_item=statuses), workcell)) == problem
