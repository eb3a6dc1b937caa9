"""Once for each element of a list."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from build_nodes import for_each

from executive.cell.objects import Target
from executive.errors import Fault
from executive.events import BranchChosen
from executive.skill import In, Skill, port
from executive.tree.blackboard import Blackboard, Wiring
from executive.tree.loops import ForEach
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.tree_node import halt


class Use(Skill):
    """Notes what it is given; `break` is a bug."""

    given: In[Any] = port(doc="a value")

    def run(self, cell: Any) -> Iterator[None]:
        cell.append(self.given)
        yield
        if self.given == "break":
            raise ValueError("a bug")


@pytest.fixture
def used() -> list[Any]:
    return []


@pytest.fixture
def make(site: Any, scope: Blackboard, used: list[Any]) -> Any:
    """Make a loop over a source whose body notes every element."""

    def make(source: Any) -> ForEach:
        body = SkillLeaf(site("use"), "Use", Use, Wiring(inputs={"given": "it"}), used)  # type: ignore[arg-type]
        return for_each(site("loop"), body, scope, "it", source)

    return make


def list_choices(events: Any) -> list[str]:
    return [event.choice for event in events if isinstance(event, BranchChosen)]


def test_the_list_is_the_one_of_the_start(make: Any, scope: Blackboard, ticks: Any, used: Any) -> None:
    todo = ["a", "b"]
    scope.update({"todo": todo})
    node = make("todo")
    node.tick_once()
    todo.append("late")
    scope.update({"todo": ["other"]})
    assert (ticks(node), used) == ("RS", ["a", "b"])
    assert (ticks(node), used) == ("RS", ["a", "b", "other"])


def test_the_current_element_is_reported(make: Any, ticks: Any, events: Any) -> None:
    target = Target("cube-2", "cube", np.zeros(3), 0.9, 1, 0, 0.0)
    ticks(make(["cube", None, target, {"a": 1}]))
    assert list_choices(events) == [
        "element 1 of 4: cube", "element 2 of 4: None", "element 3 of 4: cube-2", "element 4 of 4: dict",
    ]  # fmt: skip
    assert BranchChosen("loop", "element 1 of 4: cube") in events


@pytest.mark.parametrize("end", ["success", "halt", "fault"])
def test_the_variable_is_gone_however_it_ends(end: str, make: Any, scope: Blackboard, ticks: Any) -> None:
    scope.update({"other": 1})
    node = make(["a", "break" if end == "fault" else "b"])
    node.tick_once()
    assert scope["it"] == "a"
    if end == "fault":
        with pytest.raises(Fault, match="ValueError: a bug"):
            ticks(node)
    elif end == "success":
        assert ticks(node)[-1] == "S"
    halt(node)
    assert dict(scope) == {"other": 1}


def test_a_list_that_nothing_wrote_is_a_fault(make: Any, scope: Blackboard) -> None:
    scope.update({"targets": []})
    with pytest.raises(Fault) as caught:
        make("todo").tick_once()
    assert "$todo, which no node has written yet; written so far: targets" in str(caught.value)
    assert caught.value.node == "loop"


@pytest.mark.parametrize(("value", "kind"), [("abc", "str"), (None, "NoneType")])
def test_what_is_no_list_is_a_fault(make: Any, scope: Blackboard, value: Any, kind: str) -> None:
    scope.update({"todo": value})
    with pytest.raises(Fault, match=f"todo holds a {kind}, not a list"):
        make("todo").tick_once()
