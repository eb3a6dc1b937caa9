"""One skill by itself: its result, its commands, faults and halts; and substitutes of skills."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from executive.cell.arm import Goal
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Steps
from executive.errors import Fault, InputError
from executive.skill import In, Out, Skill, param, port
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import make_failing, make_raising
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.await_request import AwaitRequest
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize
from skills.select_target import SelectTarget
from skills.wait import Wait


class Worker(Skill):
    """Do what `way` says."""

    given: In[str] = port(doc="a value")
    made: Out[str] = port(doc="a value")
    way: str = param("ok", doc="what happens")
    reasons: ClassVar = ("bad",)

    def run(self, cell: Any) -> Iterator[Any]:
        yield
        if self.way == "fail":
            raise self.failure("bad", "3 mm off")
        if self.way == "break":
            raise ValueError("a bug")
        if self.way != "forget":
            self.made = f"made of {self.given}"


class Coast(Skill):
    """Set the arm in motion and do not stop it."""

    def run(self, cell: Any) -> Iterator[None]:
        planning = cell.arm.plan(goal=Goal((0.5, 0.2, 0.2)))
        while not planning.ready:
            yield
        cell.arm.start(planning.result())
        while True:
            yield


def test_a_skill_or_a_class_with_inputs_is_run_to_its_end(fake: FakeCell) -> None:
    result = run_skill(Worker, fake, inputs={"given": "stone"})
    assert (result.status, result.outputs, result.ticks) == ("SUCCESS", {"made": "made of stone"}, 1)
    assert run_skill(Worker(given="wood"), fake).outputs == {"made": "made of wood"}
    failed = run_skill(Worker(given="wood", way="fail"), fake)
    assert (failed.status, failed.reason, failed.message) == ("FAILURE", "bad", "3 mm off")
    assert failed.outputs == {}
    with pytest.raises(InputError, match="an instance of Worker takes no `inputs`"):
        run_skill(Worker(given="wood"), fake, inputs={"way": "fail"})


@pytest.mark.parametrize(
    ("inputs", "error", "text"),
    [
        ({"givne": "stone"}, InputError, 'Worker has no param or input "givne"; it has: way, given'),
        ({"made": "stone", "given": ""}, InputError, 'Worker has no param or input "made"'),
        ({}, InputError, 'Worker needs a value for "given"'),
        ({"given": "", "way": "forget"}, Fault, "it succeeded without setting its output made"),
        ({"given": "", "way": "break"}, ValueError, "a bug"),
    ],
)
def test_what_would_be_refused_or_a_fault_in_a_mission_is_raised(
    fake: FakeCell, inputs: dict[str, str], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        run_skill(Worker, fake, inputs=inputs)


def test_the_commands_of_a_look_and_a_pick_are_listed_as_texts(fake: FakeCell, target: Target) -> None:
    look = run_skill(Detect, fake, inputs={"view": "full"})
    assert look.commands == ["camera.capture", "embedded.request frame 2 full"]
    located = run_skill(Localize, fake, inputs=look.outputs)
    assert located.commands == ["ledger.observe 1 found in frame 2"]
    assert run_skill(SelectTarget, fake, inputs=located.outputs).commands == ["decided cube-1 red_bin"]
    approach = run_skill(Approach, fake, inputs={"target": target})
    moved = ["arm.plan (0.5, 0.0, 0.035)", "arm.start", "arm.stop"]
    assert approach.commands == [*moved, "ledger.record_measurement cube-1"]
    grasp = run_skill(Grasp, fake, inputs={"target": target})
    assert grasp.commands == ["tool.close", "ledger.record_grasp cube-1"]
    assert run_skill(AwaitRequest, fake).commands == ["operator.ask"]


def test_a_halt_brakes_the_arm(fake: FakeCell, target: Target) -> None:
    result = run_skill(Approach, fake, inputs={"target": target}, halt_at=30)
    assert (result.status, result.ticks, result.braking_steps) == ("HALTED", 30, 0)
    assert result.commands == ["arm.plan (0.5, 0.0, 0.035)", "arm.start", "arm.stop"]


def test_a_halt_that_leaves_the_arm_in_motion_shows(fake: FakeCell, monkeypatch: pytest.MonkeyPatch) -> None:
    result = run_skill(Coast, fake, halt_at=40)
    assert "arm.stop" not in result.commands
    assert (result.braking_steps or 0) > 10
    assert fake.arm.at_rest, "the motion was over by then"
    start = fake.cell.clock.now
    monkeypatch.setattr(type(fake.arm), "at_rest", False)
    assert run_skill(Wait, fake, inputs={"seconds": 1.0}, halt_at=0).braking_steps is None
    assert fake.cell.clock.now == pytest.approx(start + 2.0, abs=0.01)


def test_a_substitute_fails_the_first_times_and_then_does_its_work(fake: FakeCell, target: Target) -> None:
    run_skill(Approach, fake, inputs={"target": target})
    slippery = make_failing(Grasp, "missed", start_count=2, message="it slips")
    assert (slippery.__name__, slippery.ports, slippery.uses) == ("FailingGrasp", Grasp.ports, Grasp.uses)
    results = [run_skill(slippery, fake, inputs={"target": target}) for _ in range(3)]
    assert [result.reason for result in results] == ["missed", "missed", ""]
    assert (results[0].message, results[0].commands) == ("it slips", [])
    assert (results[2].outputs, fake.tool.holding) == ({"held": "cube-1"}, True)
    with pytest.raises(InputError, match='Grasp cannot fail with "dropped"; it declares: missed'):
        make_failing(Grasp, "dropped")


def test_a_bug_comes_up_in_mid_work_and_the_skill_cleans_up(fake: FakeCell, target: Target) -> None:
    broken = make_raising(Approach, ZeroDivisionError("in the model"), delay_steps=40)
    with pytest.raises(ZeroDivisionError, match="in the model"):
        run_skill(broken, fake, inputs={"target": target})
    assert fake.tick_count >= 40
    assert fake.arm.commands == ["start", "stop"]


def test_a_bug_in_finally_comes_up_in_a_halt_and_not_without_one(fake: FakeCell, target: Target) -> None:
    class Broken(Approach):
        """Approach the target."""

        def run(self, cell: Cell) -> Steps:
            try:
                yield from super().run(cell)
            except GeneratorExit:
                raise ValueError("in finally") from None

    with pytest.raises(Fault, match="ValueError while it was halted: in finally"):
        run_skill(Broken, fake, inputs={"target": target}, halt_at=40)
    assert fake.arm.commands == ["start", "stop"], "the skill's own finally ran before"
    assert run_skill(Broken, fake, inputs={"target": target}).status == "SUCCESS"
