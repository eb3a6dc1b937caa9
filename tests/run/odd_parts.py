"""Skill, behaviour and control node of another project, which do something odd at a chosen place."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import NoReturn

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import move_to_pose
from executive.skill import Skill
from executive.tree.flow import Flow, FlowFunction, FlowState
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode, NodeBehaviour


class PanicException(BaseException):
    """A panic of an extension module."""


class Silent(Exception):
    """An exception without a text."""

    def __str__(self) -> str:
        raise RuntimeError("no text")


def throw(error: BaseException) -> NoReturn:
    raise error


def recurse() -> None:
    recurse()


def loop(caught: type[BaseException]) -> None:
    while True:
        try:
            while True:
                pass
        except caught:
            pass


EFFECTS: dict[str, Callable[[], object]] = {
    "exit": lambda: throw(SystemExit(0)),
    "cancel": lambda: throw(asyncio.CancelledError()),
    "close": lambda: throw(GeneratorExit()),
    "interrupt": lambda: throw(KeyboardInterrupt()),
    "panic": lambda: throw(PanicException("index out of bounds")),
    "silent": lambda: throw(Silent()),
    "stop iteration": lambda: throw(StopIteration(1)),
    "memory": lambda: throw(MemoryError()),
    "long text": lambda: throw(ValueError("much " * 2_000_000)),
    "recursion": recurse,
    "loop": lambda: loop(ZeroDivisionError),
    "stubborn loop": lambda: loop(Exception),
}
chosen: dict[str, Callable[..., object]] = {}
"""Effect by place."""


def act(place: str) -> None:
    chosen.get(place, lambda: None)()


class OddSkill(Skill):
    """Move aside."""

    reasons = ("odd", "unreachable", "blocked")
    uses = ("arm",)
    moves = True

    def run(self, cell: Cell) -> Steps:
        act("start")
        try:
            for number, _ in enumerate(move_to_pose(self, cell, lambda: "aside")):
                if number == 30:
                    act("moving")
                yield
        finally:
            act("finally")
        chosen.get("end", lambda _: None)(self)


class OddBehaviour(Behaviour):
    """Run for a second."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def setup(self, **_: object) -> None:
        act("setup")

    def initialise(self) -> None:
        act("initialise")

    def update(self) -> Status:
        act("update")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        act("terminate")

    def shutdown(self) -> None:
        act("shutdown")


class OddNode(ControlNode):
    """Run the child."""

    keyword = "odd"
    symbol = "?"
    do: Child = key(shorthand=True, doc="The child.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        return get_flow(self.do, state)

    class Behaviour(NodeBehaviour):
        node: OddNode

        def start(self) -> None:
            act("node start")

        def step(self) -> Status:
            act("step")
            return self.tick_child(self.node.do)

        def clean_up(self) -> None:
            act("clean up")
