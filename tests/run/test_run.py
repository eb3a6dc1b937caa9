from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from executive.behaviours import load_skills
from executive.cell.devices import TrueObject
from executive.events import Event, RequestGiven, RunEnded, TimedEvent, ToolCommanded
from executive.mission.load import load_mission
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.testing.fake_cell import FakeCell


def make(
    missions: Path, name: str = "sort_overhead", seed: int = 3, **options: Any
) -> tuple[Run, list[Event]]:
    events: list[Event] = []
    loaded = load_mission(missions / f"{name}.yaml", load_skills(), {"cell.table.objects": "[2, 2]"})
    observers = [events.append, *options.pop("observers", [])]
    return assemble(loaded, RunOptions(seed, make_cell=FakeCell, **options), observers), events


def fake_of(run: Run) -> FakeCell:
    assert isinstance(run.station, FakeCell)
    return run.station


def running(run: Run) -> list[str]:
    return [node.name for node in run.root.iterate() if node.status is Status.RUNNING]


def never_seal(fake: FakeCell, stubborn: TrueObject) -> None:
    fake.tool.can_hold = lambda: fake.tool.find_object() is not stubborn


def always_slip(fake: FakeCell, stubborn: TrueObject) -> None:
    advance = fake.advance

    def slipping() -> None:
        advance()
        if fake.world.held_object is stubborn and fake.arm.tool_pose.position[2] > 0.12:
            fake.tool.open()
        assert fake.tick_count < 60_000, "the mission tries for ever"

    fake.advance = slipping  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("resist", "cause"),
    [(never_seal, ""), (always_slip, "; too heavy for the tool, or slippery: the tool dropped it 6 times")],
)
def test_an_object_that_cannot_be_had_is_rejected_and_the_others_go_on(
    missions: Path, resist: Callable[[FakeCell, TrueObject], None], cause: str
) -> None:
    run, _ = make(missions)
    resist(fake_of(run), fake_of(run).world.objects[0])
    outcome = run.execute()
    items = run.station.ledger.count_states()
    audit = run.station.audit()
    assert (outcome.status, outcome.reason) == ("INCOMPLETE", "rejected")
    (rejected,) = (row for row in run.station.ledger.list_items() if row.state == "rejected")
    assert rejected.reason == f"could not be picked (6 failed attempts){cause}"
    assert outcome.message == f"1 object(s) were not sorted: {rejected.item} ({rejected.reason})"
    assert (items["rejected"], audit["left"], rejected.attempts) == (1, 1, 6)
    assert items["placed"] == audit["right"] == items["seen"] - 1


def test_a_bug_in_a_part_is_a_fault_and_the_arm_is_at_rest(missions: Path) -> None:
    run, events = make(missions)
    fake = fake_of(run)

    def broken() -> bool:
        raise ZeroDivisionError("vacuum gauge")

    fake.tool.can_hold = broken
    outcome = run.execute()
    assert (outcome.status, outcome.node.rpartition("/")[2]) == ("FAULT", "Grasp")
    assert "vacuum gauge" in outcome.message and fake.arm.at_rest
    assert (running(run), type(events[-1].event)) == ([], RunEnded)


def test_ctrl_c_halts_every_node_and_brakes_the_arm(missions: Path) -> None:
    def interrupt(timed: TimedEvent) -> None:
        if isinstance(timed.event, ToolCommanded) and not sent:
            sent.append(1)
            os.kill(os.getpid(), signal.SIGINT)

    sent: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    run, events = make(missions, observers=[interrupt])
    outcome = run.execute()
    assert (outcome.status, outcome.message) == ("HALTED", "halted by the user")
    assert fake_of(run).arm.at_rest
    assert (running(run), type(events[-1].event)) == ([], RunEnded)
    assert signal.getsignal(signal.SIGINT) is before


def test_requests_are_served_in_order_and_the_rest_is_left(missions: Path) -> None:
    run, events = make(missions, "pick_on_request", requests=["cube", "s", "0", "q"])
    fake = fake_of(run)
    fake.world.objects.clear()
    for label, x, y in (("cube", 0.45, -0.1), ("cube", 0.55, 0.1), ("duck", 0.5, 0.0)):
        fake.world.put(label, x, y)
    outcome = run.execute()
    items = run.station.ledger.count_states()
    audit = run.station.audit()
    assert outcome.status == "SUCCESS"
    requests = [one.event.request for one in events if isinstance(one.event, RequestGiven)]
    assert requests == ["cube", "rescan", "cube", None]
    assert (items["placed"], items["skipped"]) == (2, 1) == (audit["right"], audit["left"])


def test_books_that_do_not_balance_are_a_fault(missions: Path) -> None:
    run, events = make(missions)
    counts = {"seen": 3, "placed": 1, "rejected": 0, "skipped": 0, "lost": 1, "phantom": 0}
    fake_of(run).ledger.count_states = lambda: counts  # type: ignore[method-assign]
    outcome = run.execute()
    assert (outcome.status, outcome.reason) == ("FAULT", "fault")
    assert "the item counts are inconsistent: 3 seen, 1 placed" in outcome.message
    assert isinstance(events[-1].event, RunEnded)
