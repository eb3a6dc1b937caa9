"""A skill as a leaf: fresh instances, committed outputs, faults, halting."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
from py_trees.common import Status

from executive.cell.objects import Target
from executive.errors import Fault
from executive.events import NodeEnded, NodeStarted
from executive.skill import In, Out, Skill, param, port
from executive.tree.blackboard import Blackboard, Wiring
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.tree_node import halt


class Worker(Skill):
    """Does what `way` says."""

    cleaned: ClassVar[list[str]] = []
    """Values of `way` of the workers of one test that were cleaned up."""

    given: In[str] = port(doc="a value")
    extra: In[str | None] = port(default=None, doc="a value")
    made: Out[str] = port(doc="a value")
    way: str = param("ok", doc="what happens")
    reasons: ClassVar = ("bad",)

    def run(self, cell: Any) -> Iterator[None]:
        assert not hasattr(self, "made"), "a used instance"
        # The garbage collector may end a worker during a later test.
        cleaned = self.cleaned
        try:
            self.made = f"{self.given} {self.extra}"
            yield
            if self.way == "fail":
                raise self.failure("bad", "3 mm off")
            if self.way == "undeclared":
                raise self.failure("worse", "")
            if self.way == "break":
                raise ValueError("a bug")
            if self.way == "forget":
                del self.made
            if self.way == "yield":
                yield iter(())  # type: ignore[misc]
            self.given = "changed inside"
        finally:
            cleaned.append(self.way)
            if self.way == "linger":
                yield
            if self.way == "break late":
                raise ValueError("a late bug")


@pytest.fixture
def scope() -> Blackboard:
    scope = Blackboard()
    scope.update({"input": "stone"})
    return scope


@pytest.fixture
def make(site: Any, scope: Blackboard, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(Worker, "cleaned", [])

    def make(way: str = "ok") -> SkillLeaf:
        wiring = Wiring({"way": way}, {"given": "input", "extra": "extra"}, {"made": "result"})
        return SkillLeaf(site("tree/Worker"), "Worker", Worker, wiring, None)  # type: ignore[arg-type]

    return make


def test_inputs_are_those_of_the_start_and_outputs_are_committed_on_success_only(
    make: Any, scope: Blackboard
) -> None:
    node = make()
    node.tick_once()
    assert node.status is Status.RUNNING and "result" not in scope
    scope.update({"input": "brick"})
    node.tick_once()
    assert node.status is Status.SUCCESS
    assert dict(scope) == {"input": "brick", "result": "stone None"}
    scope["extra"] = "new"
    node.tick_once()
    node.tick_once()
    assert scope["result"] == "brick new"


def test_a_failure_writes_nothing_and_says_why(make: Any, scope: Blackboard, ticks: Any) -> None:
    node = make("fail")
    assert ticks(node) == "RF"
    failure = node.failure
    assert (str(failure), failure.message, failure.path) == ("Worker.bad", "3 mm off", "tree/Worker")
    assert "result" not in scope


@pytest.mark.parametrize(
    ("way", "sentence"),
    [
        ("break", "ValueError: a bug"),
        ("undeclared", 'undeclared reason "worse"; it declares: bad'),
        ("forget", "without setting its output made"),
        ("yield", "it yielded a tuple_iterator"),
    ],
)
def test_a_bug_in_a_skill_is_a_fault(make: Any, way: str, sentence: str, events: Any) -> None:
    node = make(way)
    node.tick_once()
    with pytest.raises(Fault, match=f"Worker: .*{sentence}") as caught:
        node.tick_once()
    assert caught.value.node == "tree/Worker"
    assert (node.status, isinstance(caught.value.__cause__, ValueError)) == (Status.INVALID, way == "break")
    assert (events[-1].status, events[-1].reason) == ("INVALID", "fault")


def test_a_missing_input_is_a_fault_that_names_it(make: Any, scope: Blackboard) -> None:
    del scope["input"]
    with pytest.raises(Fault, match=r'"given" reads \$input, .*; written so far: nothing'):
        make().tick_once()


def test_halting_runs_the_finally_of_the_skill_unless_it_ended(make: Any, ticks: Any, events: Any) -> None:
    node = make()
    node.tick_once()
    assert halt(node) == []
    assert (Worker.cleaned, node.status, events[-1].status) == (["ok"], Status.INVALID, "INVALID")
    assert ticks(node) == "RS"
    before = len(events)
    node.stop(Status.INVALID)
    assert (Worker.cleaned, len(events)) == (["ok", "ok"], before)


@pytest.mark.parametrize(
    ("way", "problem"),
    [
        ("linger", "it yielded while it was halted"),
        ("break late", "ValueError while it was halted: a late bug"),
    ],
)
def test_a_skill_that_does_not_stop_cleanly_is_reported(make: Any, way: str, problem: str) -> None:
    node = make(way)
    node.tick_once()
    (message,) = halt(node)
    assert message.startswith("tree/Worker: Worker: ") and problem in message
    assert node.status is Status.INVALID


class Sort(Skill):
    """Finds what goes into a box."""

    colour: In[str] = port(doc="a value")
    box: In[str] = port(refers_to="item", doc="a value")
    unlike: In[str | None] = port(default=None, refers_to="item", doc="a value")
    found: Out[str] = port(refers_to="item", doc="a value")

    def run(self, cell: Any) -> Iterator[None]:
        yield
        self.found = "cube-9" if self.colour == "red" else ""


@pytest.mark.parametrize(("colour", "items"), [("red", ["box-1", "cube-9"]), ("blue", ["box-1", "box-1"])])
def test_the_item_is_what_a_port_names_that_the_skill_always_has(
    colour: str, items: list[str], site: Any, ticks: Any, events: Any
) -> None:
    scope = site().blackboard
    scope.update({"box": "box-1", "unlike": "cube-2", "colour": colour})
    inputs = {name: name for name in ("unlike", "colour", "box")}
    wiring = Wiring({}, inputs, {"found": "found"})
    assert ticks(SkillLeaf(site("tree/Sort"), "Sort", Sort, wiring, None)) == "RS"  # type: ignore[arg-type]
    outputs = {"found": "cube-9" if colour == "red" else ""}
    assert events == [
        NodeStarted("tree/Sort", "Sort", items[0]),
        NodeEnded("tree/Sort", "SUCCESS", "Sort", items[1], outputs=outputs),
    ]


def test_the_item_of_a_target_is_the_item_of_the_skill(site: Any, events: Any) -> None:
    scope = site().blackboard
    scope["input"] = Target("cube-2", "cube", np.zeros(3), 0.9, 1, 0, 0.0)
    wiring = Wiring({}, {"given": "input"}, {"made": "made"})
    SkillLeaf(site(), "Worker", Worker, wiring, None).tick_once()  # type: ignore[arg-type]
    assert events[0].item == "cube-2"
