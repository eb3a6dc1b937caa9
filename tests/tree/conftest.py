"""Scripted leaves, a clock, and a record of what happened."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hand_set_clock import Clock
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.events import Event
from executive.tree.blackboard import Blackboard, NodeContext

LEDGER: Any = None
"""The nodes of these tests read no items."""


@pytest.fixture
def log() -> list[str]:
    return []


@pytest.fixture
def leaf(log: list[str]) -> Callable[..., Leaf]:
    return lambda name, *scripts: Leaf(name, scripts or ("S",), log)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def events() -> list[Event]:
    return []


@pytest.fixture
def scope() -> Blackboard:
    return Blackboard()


@pytest.fixture
def site(events: list[Event], clock: Clock, scope: Blackboard) -> Callable[..., NodeContext]:
    return lambda path="node", label="": NodeContext(path, clock, LEDGER, scope, label, events.append)


@pytest.fixture
def ticks() -> Callable[..., str]:
    """Tick a node to its end and return every status by its first letter."""

    def ticks(node: Behaviour, most: int = 50) -> str:
        seen = ""
        for _ in range(most):
            node.tick_once()
            seen += node.status.value[0]
            if node.status is not Status.RUNNING:
                break
        return seen

    return ticks
