"""The data of a run on the blackboard of py_trees."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from py_trees.blackboard import Blackboard, Client
from py_trees.common import Access

from executive.behaviours import behaviour_skill as run_blackboard
from executive.behaviours.behaviour_skill import RunBlackboard
from executive.cell.clock import StepClock


@pytest.fixture(autouse=True)
def _same_blackboard_after_the_test() -> Iterator[None]:
    before = (Blackboard.storage, Blackboard.metadata, Blackboard.clients, Blackboard.activity_stream)
    yield
    after = (Blackboard.storage, Blackboard.metadata, Blackboard.clients, Blackboard.activity_stream)
    assert all(one is other for one, other in zip(before, after, strict=True))


def make_clock() -> StepClock:
    return StepClock(lambda: 0.0)


def test_data_belong_to_the_run_and_are_invisible_outside() -> None:
    clock = make_clock()
    with RunBlackboard(clock):
        Blackboard.set("/size", 3)
    assert "/size" not in Blackboard.storage
    with RunBlackboard(clock):
        assert Blackboard.get("/size") == 3
    with RunBlackboard(make_clock()):
        assert not Blackboard.exists("/size")


def test_an_inner_block_of_another_run_returns_to_the_outer_one() -> None:
    with RunBlackboard(make_clock()):
        Blackboard.set("/outer", 1)
        with RunBlackboard(make_clock()):
            assert not Blackboard.exists("/outer")
        assert Blackboard.exists("/outer")


def test_clients_remain_neither_outside_nor_in_the_run() -> None:
    clock, before = make_clock(), len(Blackboard.clients)
    for _ in range(3):
        with RunBlackboard(clock):
            client = Client(name="writer")
            client.register_key("size", Access.EXCLUSIVE_WRITE)
            assert len(Blackboard.clients) == 1
    assert len(Blackboard.clients) == before


def test_an_activity_stream_stays_with_its_run() -> None:
    board = RunBlackboard(make_clock())
    with board:
        Blackboard.enable_activity_stream()
    assert Blackboard.activity_stream is None
    with board:
        assert Blackboard.activity_stream is not None


def test_the_blackboard_returns_after_an_exception() -> None:
    with pytest.raises(ZeroDivisionError), RunBlackboard(make_clock()):
        raise ZeroDivisionError


def test_the_data_of_a_run_end_with_its_clock() -> None:
    gc.collect()
    clock = make_clock()
    RunBlackboard(clock)
    count = len(run_blackboard._STORAGE_BY_CLOCK)
    del clock
    gc.collect()
    assert len(run_blackboard._STORAGE_BY_CLOCK) == count - 1
