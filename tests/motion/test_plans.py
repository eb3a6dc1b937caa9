"""Plans of a worker thread: when they are ready, and who gets the errors."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from executive.cell.arm import Goal, Task
from executive.cell.clock import STEP, StepClock
from executive.errors import Blocked
from executive.events import Event, MotionPlanned
from executive.geometry import Array
from executive.motion.plans import PlanFactory

PLANNING_TIME = 0.1
START = np.zeros(3)


@dataclass(frozen=True)
class Line:
    """A motion that knows the thread of its planning."""

    duration: float
    thread: str


class Bench:
    """A factory of plans whose planner waits for the event `may_end`."""

    def __init__(self, *, is_realtime: bool) -> None:
        self.time, self.may_end, self.events, self.goals = 0.0, threading.Event(), list[Event](), list[str]()
        clock = StepClock(lambda: self.time)
        self.worker = ThreadPoolExecutor(1, "planner")
        submit = partial(self.worker.submit, self.plan)
        self.factory = PlanFactory(submit, clock, PLANNING_TIME, self.events.append, is_realtime=is_realtime)

    def plan(self, start: Array, goal: Goal | str, task: Task) -> Line:
        assert self.may_end.wait(10)
        self.goals.append(str(goal))
        if goal == "blocked":
            raise Blocked("a wall")
        if goal == "bug":
            raise ZeroDivisionError("a bug")
        return Line(2.0, threading.current_thread().name)


@pytest.fixture
def make_bench() -> Iterator[type[Bench]]:
    benches = list[Bench]()

    def make(*, is_realtime: bool) -> Bench:
        benches.append(Bench(is_realtime=is_realtime))
        return benches[-1]

    yield make
    for bench in benches:
        bench.may_end.set()
        bench.worker.shutdown()


def test_in_real_time_no_tick_waits_for_the_worker(make_bench) -> None:
    bench = make_bench(is_realtime=True)
    plan = bench.factory.plan(START, "home", Task())
    assert not plan.ready
    bench.time = 5.0
    assert not plan.ready, "the planner still runs"
    assert bench.events == []
    bench.may_end.set()
    plan.future.exception(10)
    assert plan.ready
    assert plan.ready
    assert bench.events == [MotionPlanned(False, 5.0, 2.0)]
    assert plan.result().thread.startswith("planner")


def test_a_fast_worker_is_not_ready_before_its_time(make_bench) -> None:
    for is_realtime in (False, True):
        bench = make_bench(is_realtime=is_realtime)
        bench.may_end.set()
        plan = bench.factory.plan(START, "home", Task())
        plan.future.exception(10)
        bench.time = PLANNING_TIME - STEP
        assert not plan.ready
        bench.time = PLANNING_TIME
        assert plan.ready
        assert bench.events == [MotionPlanned(False, PLANNING_TIME, 2.0)]


@pytest.mark.parametrize(("goal", "error"), [("blocked", Blocked), ("bug", ZeroDivisionError)])
def test_an_error_of_the_planner_is_raised_by_the_result(make_bench, goal: str, error) -> None:
    bench = make_bench(is_realtime=False)
    bench.may_end.set()
    bench.factory.plan_ahead(START, goal, Task())
    bench.time = PLANNING_TIME
    plan = bench.factory.plan(START, goal, Task())
    assert plan.ready
    assert bench.events == [MotionPlanned(True, 0.0, 0.0)]
    with pytest.raises(error, match=r"a (wall|bug)"):
        plan.result()


def test_a_plan_that_another_one_replaces_is_dropped(make_bench) -> None:
    bench = make_bench(is_realtime=False)
    for goal in ("first", "second", "third"):  # the worker has begun with the first
        bench.factory.plan_ahead(START, goal, Task())
    plan = bench.factory.plan(START, "fourth", Task())
    bench.may_end.set()
    bench.time = PLANNING_TIME
    assert plan.ready
    assert bench.goals in (["first", "fourth"], ["fourth"])
    assert len(bench.events) == 1
