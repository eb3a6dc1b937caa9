"""What a class body declares, and what its author is told of a mistake in it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, cast

import pytest

from executive.cell.protocols import Cell
from executive.skill import ANY, In, Metres, Out, Skill, param, port
from executive.tree.skill_leaf import SkillRun


@pytest.mark.parametrize(
    ("members", "text"),
    [
        ({"times": param(2)}, r'times has no type annotation.*"times: int = param'),
        ({"times": 3, "__annotations__": {"times": int}}, r"times: attributes of a skill are In"),
        ({"tool_left": {}}, "tool_left: the attribute is now tool_state_after_failure"),
        ({"run": print}, 'the docstring of Knock begins with "", which is not a sentence'),
        ({"door": port(), "__annotations__": {"door": In[str]}}, r"Knock.door has no doc. Write port"),
        ({"reasons": "tired"}, r'reasons is the string "tired". Write a tuple: \("tired",\)'),
        ({"uses": ("tool", "gripper")}, "uses gripper. Write a tuple"),
        ({"moves": True}, 'moves the arm but does not use it. Add "arm" to uses'),
        ({"tool_state": "empty"}, "tool_state is 'empty'. Write two of ANY, EMPTY and HOLDING"),
        ({"tool_state_after_failure": {"lost": ANY}}, 'has "lost", which is not a reason of the skill'),
        ({"is_condition": True, "uses": ("tool",)}, "uses the tool, and declares is_condition"),
    ],
)
def test_a_wrong_declaration_is_refused(members: dict[str, Any], text: str) -> None:
    with pytest.raises(TypeError, match=text):
        type("Knock", (Skill,), {"__annotations__": {}, **members})


@pytest.mark.parametrize(
    ("annotation", "declared", "problem"),
    [
        (Metres, param(0.1, ge=0.2, doc="a gap"), "at least 0.2 m, not 0.1"),
        (Metres, param(0.3, le=0.2, doc="a gap"), "at most 0.2 m, not 0.3"),
        (int, param(True, doc="a count"), "of the type int, not True"),
        (str, param("rows", choices=("columns", "none"), doc="an order"), "'columns' or 'none', not 'rows'"),
    ],
)
def test_a_default_that_is_not_allowed_is_refused(annotation: Any, declared: Any, problem: str) -> None:
    with pytest.raises(TypeError, match=rf"the default of Knock\.gap must be {problem}\. Correct"):
        type("Knock", (Skill,), {"__annotations__": {"gap": annotation}, "gap": declared})


class Knock(Skill):
    """Knock at a door; defaults may be equal to bounds, None, or a name of the cell."""

    times: int = param(2, ge=2, le=2, doc="a count")
    limit: float | None = param(None, ge=1, doc="a limit")
    length: Metres = param(1, doc="a whole number")
    pose: str = param("home", refers_to="pose", choices=("auto",), doc="a name of the cell, or auto")

    def min_time(self) -> float:
        """Return a value that nobody reads; former skills define this method."""
        return 0.0


def test_a_default_that_is_changed_needs_its_annotation_again() -> None:
    with pytest.raises(TypeError, match=r"Louder\.times has no type annotation"):
        type("Louder", (Knock,), {"times": param(3)})


class Choose(Skill):
    """A skill whose inputs, outputs and params have names that are words of Python."""

    not_: In[str] = port(doc="the excluded name")
    class_: str = param("", doc="a class")
    in_: Out[str] = port(doc="the place")

    def run(self, cell: Cell) -> None:
        """Join the names."""
        self.in_ = self.not_ + self.class_


def test_a_port_may_be_named_like_a_word_of_python() -> None:
    assert (list(Choose.ports), list(Choose.params)) == (["not", "in"], ["class"])
    run = SkillRun(Choose(**{"not": "here", "class": "!"}), cast("Cell", None))
    assert run.step()
    assert run.read_outputs() == {"in": "here!"}


def test_a_skill_is_instantaneous_if_its_run_has_no_steps_and_declares_it() -> None:
    class Plain(Skill):
        """Have no steps."""

        def run(self, cell: Cell) -> None:
            del cell

    class Steps(Skill):
        """Have steps."""

        def run(self, cell):  # type: ignore[no-untyped-def]
            yield

    class Delegating(Skill):
        """Have the steps of another skill."""

        def run(self, cell: Cell) -> Iterator[None]:
            return Steps().run(cell)

    class Condition(Steps):
        is_condition: ClassVar = True

    skills = (Plain, Steps, Delegating, Condition)
    assert [skill.is_instantaneous() for skill in skills] == [True, False, False, True]
