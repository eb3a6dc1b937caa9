"""Runs of control nodes over scripted leaves: statuses, who runs in which order, failures and choices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from build_nodes import (
    fallback,
    for_each,
    invert,
    lead,
    make_site,
    parallel,
    repeat,
    retry,
    sequence,
    succeed,
    try_catch,
    while_loop,
)
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.events import BranchChosen, Event
from executive.tree.blackboard import Blackboard
from executive.tree.loops import ForEach
from executive.tree.retry import TryCatch
from executive.tree.tree_node import halt

LOST, EMPTY = [("A", "lost")], [("A", "empty")]


class Make:
    """Makes leaves from texts (`A: R lost | R S`: a name, and a script per start), and keeps their log."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.choices: list[str] = []
        self.leaves: list[Leaf] = []
        self.site = make_site("node", "", self._emit)

    def __call__(self, *texts: str) -> list[Leaf]:
        return [self.one(text) for text in texts]

    def one(self, text: str) -> Leaf:
        name, _, scripts = text.partition(": ")
        self.leaves.append(Leaf(name, tuple(scripts.split(" | ")) if scripts else ("S",), self.log))
        return self.leaves[-1]

    def each(self, elements: list[Any], text: str) -> ForEach:
        return for_each(self.site, self.one(text), Blackboard(), "it", elements)

    def caught(self, body: str, *catches: tuple[list[tuple[str, str]], str], last: str = "") -> TryCatch:
        handlers = [(names, self.one(text)) for names, text in catches]
        return try_catch(self.site, self.one(body), handlers, self.one(last) if last else None)

    def _emit(self, event: Event) -> None:
        if isinstance(event, BranchChosen):
            self.choices.append(f"{event.choice}, {event.reason}")


def tick_to_end(node: Behaviour, is_visited: bool = False) -> list[str]:
    """Tick a node to its end, at most 12 times, as for a visitor or directly; return its statuses."""
    statuses: list[str] = []
    while len(statuses) < 12 and statuses[-1:] in ([], ["RUNNING"]):
        if is_visited:
            list(node.tick())
        else:
            node.tick_once()
        statuses.append(node.status.value)
    return statuses


CASES: list[tuple[Callable[[Make], Behaviour], str, str, str | None]] = [
        (lambda m: sequence(m.site, m("A: R S", "B", "C: R S")), "RRS", "A B C", None),
        (lambda m: sequence(m.site, m("A", "B: lost", "C")), "F", "A B", "B.lost"),
        (lambda m: sequence(m.site, m("A: lost | S")), "FS", "A A", None),
        (lambda m: fallback(m.site, m("A: lost", "B: stuck")), "F", "A B", "B.stuck"),
        (lambda m: fallback(m.site, m("A: lost", "B: R R R S", "C")), "RRRS", "A B", None),
        (lambda m: invert(m.site, m.one("A: R lost")), "RS", "A", None),
        (lambda m: invert(m.site, m.one("A: R S")), "RF", "A", "invert.inverted"),
        (lambda m: succeed(m.site, m.one("A: R lost")), "RS", "A", None),
            (lambda m: succeed(m.site), "S", "", None),
        # try: the first catch that names the failure; finally after success and failure
        (lambda m: m.caught("A: stuck", ([("B", "stuck")], "B"), ([*LOST, ("A", "stuck")], "C: R S")),
         "RS", "A C", None),
        (lambda m: m.caught("A: lost", ([("A", "stuck")], "B")), "F", "A", "A.lost"),
            (lambda m: m.caught("A", (LOST, "B"), last="Z: R S"), "RS", "A Z", None),
        (lambda m: m.caught("A: lost", (LOST, "B"), last="Z"), "S", "A B Z", None),
        (lambda m: m.caught("A: other", (LOST, "B"), last="Z"), "F", "A Z", "A.other"),
        (lambda m: m.caught("A: lost", (LOST, "B: stuck"), last="Z"), "F", "A B Z", "B.stuck"),
        (lambda m: m.caught("A", (LOST, "B"), last="Z: late"), "F", "A Z", "Z.late"),
        (lambda m: m.caught("A: other", (LOST, "B"), last="Z: late"), "F", "A Z", "A.other"),
        # retry: in the tick of the failure if time passed, else in the next
        (lambda m: retry(m.site, m.one("A: R lost | R lost | R S"), 3), "RRRS", "A A A", None),
        (lambda m: retry(m.site, m.one("A: R lost | R stuck"), 2), "RRF", "A A", "A.stuck"),
        (lambda m: retry(m.site, m.one("A: R lost"), 2), "RRFRRF", "A A A A", "A.lost"),
        (lambda m: retry(m.site, m.one("A: R lost | R stuck | S"), 5, LOST), "RRF", "A A", "A.stuck"),
        (lambda m: retry(m.site, m.one("A: R lost"), 3, LOST, m.one("B: R S")),
         "RRRRRF", "A B A B A", "A.lost"),
            (lambda m: retry(m.site, m.one("A: lost"), 3, [], m.one("B")), "RRF", "A B A B A", "A.lost"),
        # repeat and while
        (lambda m: repeat(m.site, m.one("A: R S"), times=3), "RRRS", "A A A", None),
            (lambda m: repeat(m.site, m.one("A"), times=3), "RRS", "A A A", None),
        (lambda m: repeat(m.site, m.one("A: R S | R S | empty"), until=EMPTY), "RRS", "A A A", None),
        (lambda m: repeat(m.site, m.one("A: R S | empty"), times=3, until=EMPTY), "RS", "A A", None),
        (lambda m: repeat(m.site, m.one("A: R S"), times=3, until=EMPTY), "RRRS", "A A A", None),
        (lambda m: repeat(m.site, m.one("A: R S | R S | lost"), times=3, until=EMPTY),
         "RRF", "A A A", "A.lost"),
        (lambda m: repeat(m.site, m.one("A"), until=EMPTY), "R" * 20, " ".join("A" * 20), None),
        (lambda m: repeat(m.site, repeat(m.site, m.one("A"), times=2), times=2), "RRS", "A A A A", None),
        (lambda m: while_loop(m.site, m.one("B: R S | S | R no"), m.one("A: R S")),
         "RRRRS", "B A B A B", None),
        (lambda m: while_loop(m.site, m.one("B: S | S | S | no"), m.one("A: R S")),
         "RRRS", "B A B A B A B", None),
        (lambda m: while_loop(m.site, m.one("B"), m.one("A: R S | R lost")), "RRF", "B A B A", "A.lost"),
            (lambda m: while_loop(m.site, m.one("B: R S | no"), m.one("A")), "RS", "B A B", None),
        # for_each
        (lambda m: m.each([1, None, 3], "A: R S"), "RRRS", "A A A", None),
        (lambda m: m.each([1, 2, 3], "A"), "RRS", "A A A", None),
        (lambda m: m.each([1, 2, 3], "A: R S | R lost"), "RRF", "A A", "A.lost"),
        (lambda m: m.each([], "A"), "S", "", None),
        # parallel: children that ended are not run again; enough successes, or the first failure
            (lambda m: parallel(m.site, m("A: R R S", "B", "C: R S")), "RRS", "A B C", None),
        (lambda m: parallel(m.site, m("A", "B: lost", "C: R R R S")), "RRRF", "A B C", "B.lost"),
        (lambda m: parallel(m.site, m("A: R S", "B: R R S", "C: R R R S"), 1), "RS", "A B C -B -C", None),
        (lambda m: parallel(m.site, m("A: R S", "B: R R S", "C: R R R S"), 2), "RRS", "A B C -C", None),
            (lambda m: parallel(m.site, m("A: R R R S", "B: R lost")), "RRRF", "A B", "B.lost"),
        (lambda m: parallel(m.site, m("A: R R R S", "B: R lost"), halt=True), "RF", "A B -A", "B.lost"),
        (lambda m: parallel(m.site, m("A: lost", "B: lost", "C: R S", "D: R R S"), 3),
         "RRF", "A B C D", "A.lost"),
        (lambda m: parallel(m.site, m("A: lost | S", "B: R S")), "RFRS", "A B A B", None),
        (lambda m: lead(m.site, m("A: R R S", "B: R R R S", "C: R R R lost")), "RRS", "A B C -B -C", None),
        (lambda m: lead(m.site, m("A: R lost", "B: R R R S")), "RF", "A B -B", "A.lost"),
        (lambda m: lead(m.site, m("A: R R R S", "B: R S")), "RRRS", "A B", None),
        (lambda m: lead(m.site, m("A: R S", "B: R R R S")), "RSRS", "A B -B A B -B", None),
]  # fmt: skip


@pytest.mark.parametrize(("build", "ticks", "order", "failure"), CASES)
def test_statuses_order_and_failure(
    build: Callable[[Make], Behaviour], ticks: str, order: str, failure: str | None
) -> None:
    make, seen = Make(), ""
    node = build(make)
    for _ in ticks:
        node.tick_once()
        seen += node.status.value[0]
    assert seen == ticks
    assert [line.replace(" starts", "") for line in make.log] == [
        f"{name[1:]} halted" if name.startswith("-") else name for name in order.split()
    ]
    assert (str(node.failure) if node.failure else None) == failure


@pytest.mark.parametrize("build", [case[0] for case in CASES])
@pytest.mark.parametrize("halt_tick", [1, 2])
def test_a_halted_node_ends_its_running_leaves_once_and_runs_again_as_a_fresh_one(
    build: Callable[[Make], Behaviour], halt_tick: int
) -> None:
    make = Make()
    node = build(make)
    fresh = tick_to_end(build(Make()), is_visited=True)
    for _ in range(halt_tick):
        node.tick_once()
    running = [f"{leaf.name} halted" for leaf in make.leaves if leaf.status is Status.RUNNING]
    make.log.clear()
    assert (halt(node), sorted(make.log), halt(node)) == ([], sorted(running), [])
    for leaf in make.leaves:
        leaf.rewind()
    assert tick_to_end(node) == fresh


@pytest.mark.parametrize(
    ("build", "choices"),
    [
        (lambda m: fallback(m.site, m("A: lost", "B", "C")), ["choice 2 of 3, A.lost"]),
        (lambda m: m.caught("A: lost", (LOST, "B")), ["catch, A.lost"]),
        (lambda m: succeed(m.site, m.one("A: lost")), ["succeed despite the failure, A.lost"]),
        (
            lambda m: retry(m.site, m.one("A: lost"), 3, [], m.one("B: broken")),
            ["attempt 2 of 3, A.lost", "give up: the recovery failed, B.broken"],
        ),
        (lambda m: while_loop(m.site, m.one("B: no"), m.one("A")), ["done, B.no"]),
        (lambda m: repeat(m.site, m.one("A: empty"), until=EMPTY), ["done, A.empty"]),
        (
            lambda m: parallel(m.site, m("A: lost", "B: R S", "C: R R R"), 1, halt=True),
            ["go on with the others, A.lost"],
        ),
        (
            lambda m: parallel(m.site, m("A: R lost", "B: R stuck", "C: R S"), 1),
            ["enough others succeeded, A.lost", "enough others succeeded, B.stuck"],
        ),
        (
            lambda m: parallel(m.site, m("A: R R late", "B: R lost", "C: R stuck")),
            [
                "let the others finish, then fail, B.lost",
                "let the others finish, then fail, C.stuck",
                "fail with B.lost, A.late",
            ],
        ),
        (lambda m: parallel(m.site, m("A", "B: lost", "C: stuck")), ["fail with B.lost, C.stuck"]),
        (lambda m: lead(m.site, m("A: R R S", "B: R stuck")), ["go on without this branch, B.stuck"]),
    ],
)
def test_choices(build: Callable[[Make], Behaviour], choices: list[str]) -> None:
    make = Make()
    node = build(make)
    node.tick_once()
    while node.status.value == "RUNNING":
        node.tick_once()
    assert make.choices == choices
