"""What a class body declares, and what its author is told of a mistake in it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, cast

import pytest

from executive.cell.protocols import Cell
from executive.skill import In, Out, Skill, param, port
from executive.tree.skill_run import SkillRun


@pytest.mark.parametrize(
    ("declared", "kind"),
    [(param(2), "int"), (param(0.5), "float"), (param("a"), "str"), (param(True), "bool"), (port(), "int")],
)
def test_what_is_declared_without_an_annotation_is_refused(declared: Any, kind: str) -> None:
    with pytest.raises(TypeError) as raised:
        type("Knock", (Skill,), {"times": declared})
    assert str(raised.value) == (
        "Knock.times has no type annotation; write, for instance, "
        f'"times: {kind} = param(...)" for a param, "times: In[...] = port(...)" for an input, '
        '"times: Out[...] = port(...)" for an output'
    )


def test_a_default_that_is_changed_needs_its_annotation_again() -> None:
    class Knock(Skill):
        times: int = param(2)

    with pytest.raises(TypeError, match=r"Louder\.times has no type annotation"):
        type("Louder", (Knock,), {"times": param(3)})


def test_the_former_name_of_an_attribute_is_an_error() -> None:
    with pytest.raises(TypeError, match=r"Old\.tool_left: the attribute is now tool_state_after_failure"):
        type("Old", (Skill,), {"__annotations__": {}, "tool_left": {}})


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
        def run(self, cell: Cell) -> None:
            del cell

    class Wrong(Skill):
        def run(self, cell: Cell) -> None:  # type: ignore[misc]
            yield

    class Bare(Skill):
        def run(self, cell):  # type: ignore[no-untyped-def]
            del cell

    class Steps(Skill):
        def run(self, cell):  # type: ignore[no-untyped-def]
            yield

    class Delegating(Skill):
        def run(self, cell: Cell) -> Iterator[None]:
            return Steps().run(cell)

    class Condition(Steps):
        is_condition: ClassVar = True

    skills = (Plain, Wrong, Bare, Steps, Delegating, Condition)
    assert [skill.is_instantaneous() for skill in skills] == [True, False, False, False, False, True]
