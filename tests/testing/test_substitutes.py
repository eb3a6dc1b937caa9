"""What runs instead of a skill goes wrong as it was told to, and otherwise is that skill."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault, InputError
from executive.testing.run_skill import run_skill
from executive.testing.substitutes import (
    make_endless,
    make_failing,
    make_raising,
    make_raising_when_halted,
    make_succeeding,
)
from skills.approach import Approach
from skills.grasp import Grasp
from skills.release import Release
from skills.wait import Wait

SUBSTITUTES = {
    "FailingGrasp": make_failing(Grasp, "missed"),
    "SucceedingGrasp": make_succeeding(Grasp, {"held": "cube-1"}),
    "RaisingGrasp": make_raising(Grasp, ValueError("a bug")),
    "RaisingWhenHaltedGrasp": make_raising_when_halted(Grasp, ValueError("a bug")),
    "EndlessGrasp": make_endless(Grasp),
}


@pytest.mark.parametrize("name", SUBSTITUTES)
def test_a_substitute_is_declared_as_the_skill_is_and_named_after_it(name: str) -> None:
    substitute = SUBSTITUTES[name]
    assert substitute.__name__ == name
    assert issubclass(substitute, Grasp)
    for declared in ("params", "ports", "reasons", "uses", "tool_state", "tool_state_after_failure"):
        assert getattr(substitute, declared) == getattr(Grasp, declared)


def test_it_fails_the_first_times_and_then_does_its_work(fake: FakeCell, target: Target) -> None:
    run_skill(Approach, fake, inputs={"target": target})
    slippery = make_failing(Grasp, "missed", start_count=2, message="it slips")
    results = [run_skill(slippery, fake, inputs={"target": target}) for _ in range(3)]
    assert [result.reason for result in results] == ["missed", "missed", ""]
    assert (results[0].message, results[0].commands) == ("it slips", [])
    assert (results[2].outputs, fake.tool.holding) == ({"held": "cube-1"}, True)


def test_a_substitute_succeeds_with_given_outputs_at_the_given_tick(fake: FakeCell) -> None:
    quick = make_succeeding(Release, {"placed": "cube-7"}, delay_steps=12)
    result = run_skill(quick, fake, inputs={"held": "cube-7", "bin": "red_bin"})
    assert (result.status, result.outputs, result.ticks) == ("SUCCESS", {"placed": "cube-7"}, 12)
    assert result.commands == []


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: make_failing(Grasp, "dropped"), 'Grasp cannot fail with "dropped"; it declares: missed'),
        (lambda: make_succeeding(Grasp), "Grasp has the outputs held, and was given none"),
        (lambda: make_succeeding(Grasp, {"held": "", "bin": ""}), "outputs held, and was given held, bin"),
    ],
)
def test_what_the_skill_does_not_declare_is_refused(make: Callable[[], object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make()


def test_a_bug_comes_up_in_mid_work_and_the_skill_cleans_up(fake: FakeCell, target: Target) -> None:
    broken = make_raising(Approach, ZeroDivisionError("in the model"), delay_steps=40)
    with pytest.raises(ZeroDivisionError, match="in the model"):
        run_skill(broken, fake, inputs={"target": target})
    assert fake.steps >= 40
    assert fake.arm.commands == ["start", "stop"]


def test_a_bug_is_raised_at_the_given_times(fake: FakeCell) -> None:
    late, once = (
        make_raising(Wait, ValueError("a bug"), **when)
        for when in ({"delay_steps": 1000}, {"start_count": 1})
    )
    with pytest.raises(ValueError, match="a bug"):
        run_skill(once, fake, inputs={"seconds": 0.1})
    assert [run_skill(skill, fake, inputs={"seconds": 0.1}).ticks for skill in (late, once)] == [24, 24]


def test_a_bug_in_finally_comes_up_in_a_halt_and_not_without_one(fake: FakeCell, target: Target) -> None:
    broken = make_raising_when_halted(Approach, ValueError("in finally"))
    with pytest.raises(Fault, match="ValueError while it was halted: in finally"):
        run_skill(broken, fake, inputs={"target": target}, halt_at=40)
    assert fake.arm.commands == ["start", "stop"], "the skill's own finally ran before"
    assert run_skill(broken, fake, inputs={"target": target}).status == "SUCCESS"


def test_it_never_ends_but_can_be_taken_away(fake: FakeCell) -> None:
    waiting = make_endless(Wait)
    assert run_skill(waiting, fake, inputs={"seconds": 0.1}, max_ticks=500).status == "RUNNING"
    assert run_skill(waiting, fake, inputs={"seconds": 0.1}, halt_at=500).status == "HALTED"
