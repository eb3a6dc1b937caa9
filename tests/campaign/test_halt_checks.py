"""Every check of a halt finds what it is there for, and nothing in a halt that was as it has to be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from py_trees.behaviours import Running
from py_trees.common import Status

from executive.campaign.halt_checks import (
    check_books,
    check_braking,
    check_ending,
    check_journal,
    check_rest,
    check_tool,
)
from executive.runtime.outcome import Outcome
from executive.testing.fake_cell import FakeCell
from executive.view.figures.halt import Halt

HALTED = Outcome("HALTED", "halted", "halted by the user", "", "", 40, 0.166667)
BOOKS = {"seen": 4, "placed": 1, "rejected": 2, "lost": 1, "phantom": 0}
AUDIT = {"right": 1, "wrong_bin": 0, "left": 3, "elsewhere": 1, "unseen": 1}


def entries(*statuses: tuple[str, str], **end: Any) -> list[dict[str, Any]]:
    """A journal of these nodes and statuses, one a tick, and an end."""
    told = [
        {"kind": "status", "tick": tick, "node": node, "status": status}
        for tick, (node, status) in enumerate(statuses)
    ]
    return [*told, {"kind": "end", "tick": 40, "status": "HALTED", "holds": "", "ticks": 40, **end}]


def test_a_run_that_ended_otherwise_is_told() -> None:
    root = Running("wait")
    assert list(check_ending(HALTED, root)) == []
    fault = replace(HALTED, status="FAULT", reason="fault", message="the arm could not be braked: no")
    assert list(check_ending(fault, root)) == [
        "the run ended as FAULT fault: the arm could not be braked: no"
    ]


def test_a_node_that_still_runs_is_told() -> None:
    root = Running("wait")
    root.status = Status.RUNNING
    assert list(check_ending(HALTED, root)) == ["wait is still running"]


def test_an_arm_that_moves_is_told(fake: FakeCell) -> None:
    assert list(check_rest(fake)) == []
    fake.arm.start(fake.arm._solve(fake.arm.destination, "home", None) or pytest.fail())
    fake.arm._path *= 20
    found = list(check_rest(fake))
    assert found[0] == "the arm is not at rest"


def test_what_took_too_long_or_went_too_far_is_told() -> None:
    good = Halt(40, 0.1667, rest=0.5, deviation=1e-7, acceleration=1.0, jerk=1.02)
    assert list(check_braking(good)) == []
    assert list(check_braking(Halt(40, 0.1667, rest=0.1))) == []
    bad = Halt(40, 0.1667, rest=0.6, deviation=2e-6, acceleration=1.1, jerk=1.5)
    assert list(check_braking(bad)) == [
        "it took 0.6 s to rest; 0.5 is allowed",
        "a command was 2e-06 rad off the path; 1e-06 is allowed",
        "the acceleration was 1.1 of its stop limit; 1 is allowed",
        "the jerk was 1.5 of its stop limit; 1.02 is allowed",
    ]


def test_a_journal_whose_nodes_all_ended_is_complete() -> None:
    ended = entries(("a", "RUNNING"), ("b", "RUNNING"), ("b", "SUCCESS"), ("b", "RUNNING"), ("b", "INVALID"))
    assert list(check_journal([*ended[:-1], {**ended[0], "status": "INVALID"}, ended[-1]], HALTED)) == []


def test_a_node_without_an_end_in_the_journal_is_told() -> None:
    assert list(check_journal(entries(("a", "RUNNING"), ("b", "RUNNING"), ("b", "INVALID")), HALTED)) == [
        "the journal says no end of a, which began at tick 0"
    ]


def test_a_node_that_begins_twice_in_the_journal_is_told() -> None:
    begun = entries(("a", "RUNNING"), ("a", "RUNNING"), ("a", "INVALID"))
    assert list(check_journal(begun, HALTED)) == ["the journal lets a begin at tick 1 while it runs"]


@pytest.mark.parametrize("journal", [[], [*entries(), *entries()], [*entries(), {"kind": "item"}]])
def test_a_journal_without_one_end_at_its_end_is_told(journal: list[dict[str, Any]]) -> None:
    (problem,) = check_journal(journal, HALTED)
    ends = sum(entry["kind"] == "end" for entry in journal)
    assert problem == f"the journal has {ends} ends in its {len(journal)} entries; only the last may be one"


def test_a_journal_that_ends_otherwise_than_the_run_is_told() -> None:
    (problem,) = check_journal(entries(holds="cube_1"), HALTED)
    assert problem.startswith("the journal ends with {'kind': 'end'")


def test_what_nobody_had_seen_yet_is_on_no_book() -> None:
    assert list(check_books(BOOKS, AUDIT)) == []
    assert list(check_books(BOOKS, None)) == []
    # A cell that does not count what nobody saw.
    assert list(check_books(BOOKS, {**AUDIT, "unseen": 0})) == []


@pytest.mark.parametrize(
    "wrong", [{"right": 2, "left": 2}, {"left": 2}, {"elsewhere": 0}, {"right": 0, "wrong_bin": 1}]
)
def test_books_that_disagree_with_the_audit_are_told(wrong: dict[str, int]) -> None:
    (problem,) = check_books(BOOKS, {**AUDIT, **wrong})
    assert problem.startswith("the ledger says seen 4, placed 1, rejected 2, lost 1; the audit right ")


def test_books_that_do_not_balance_are_told() -> None:
    assert list(check_books({**BOOKS, "seen": 5}, None)) == [
        "the ledger does not balance: seen 5, placed 1, rejected 2, lost 1"
    ]


@pytest.mark.parametrize(
    ("holding", "told", "problem"),
    [
        (True, "cube_1", []),
        (False, "", []),
        (True, "", ['the tool holds an object, and the run says ""']),
        (True, "something", ['the tool holds an object, and the run says "something"']),
        (False, "cube_1", ['the tool holds nothing, and the run says "cube_1"']),
    ],
)
def test_what_the_tool_holds_must_be_told_by_name(holding: bool, told: str, problem: list[str]) -> None:
    workcell: Any = SimpleNamespace(
        cell=SimpleNamespace(tool=SimpleNamespace(holding=holding)),
        accounts=SimpleNamespace(rows=lambda: [{"item": "cube_1"}]),
    )
    assert list(check_tool(replace(HALTED, holds=told), workcell)) == problem
