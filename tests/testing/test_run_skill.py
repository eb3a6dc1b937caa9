"""One skill by itself: what it did, what it said, and how it was taken away."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from executive.cell.arm import Goal
from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault, InputError
from executive.skill import In, Out, Skill, param, port
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.await_request import AwaitRequest
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize
from skills.release import Release
from skills.select_target import SelectTarget
from skills.transit import Transit


class Worker(Skill):
    """Does what `way` says."""

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
        if self.way == "yield":
            yield iter(())
        if self.way != "forget":
            self.made = f"made of {self.given}"


class Plain(Skill):
    """Does its work at once, without a yield."""

    made: Out[str] = port(doc="a value")

    def run(self, cell: Any) -> Any:
        cell.tool.open()
        self.made = "at once"


class Coaster(Skill):
    """Sets the arm in motion and does not care."""

    uses: ClassVar = ("arm",)

    def run(self, cell: Any) -> Iterator[None]:
        planning = cell.arm.plan(Goal((0.5, 0.2, 0.2)))
        while not planning.ready:
            yield
        cell.arm.start(planning.result())
        while True:
            yield


def test_params_and_inputs_are_given_to_the_class_or_to_the_instance(fake: FakeCell) -> None:
    result = run_skill(Worker, fake, inputs={"given": "stone"})
    assert (result.status, result.outputs, result.ticks) == ("SUCCESS", {"made": "made of stone"}, 1)
    assert run_skill(Worker(given="wood"), fake).outputs == {"made": "made of wood"}
    with pytest.raises(InputError, match="an instance of Worker takes no `inputs`; pass the class Worker"):
        run_skill(Worker(given="wood"), fake, inputs={"way": "fail"})


def test_a_failure_has_a_reason_and_commits_nothing(fake: FakeCell) -> None:
    result = run_skill(Worker, fake, inputs={"given": "stone", "way": "fail"})
    assert (result.status, result.reason, result.message, result.outputs) == (
        "FAILURE", "bad", "3 mm off", {},
    )  # fmt: skip


class Sly(Worker):
    """Fails for a reason of its parent's that it does not declare."""

    reasons: ClassVar = ()

    def run(self, cell: Any) -> Iterator[None]:
        yield
        raise Worker(given="").failure("bad", "")


@pytest.mark.parametrize(
    ("skill", "inputs", "error", "sentence"),
    [
        (Worker, {"givne": "stone"}, InputError, 'Worker has no param or input "givne"; it has: way, given'),
        (Worker, {"made": "stone", "given": ""}, InputError,
         'Worker has no param or input "made"; it has: way, given'),
        (Worker, {}, InputError, 'Worker needs a value for "given"'),
        (Worker, {"given": "", "way": "forget"}, Fault, "it succeeded without setting its output made"),
        (Worker, {"given": "", "way": "yield"}, Fault,
         'it yielded a tuple_iterator; to run the steps of another generator, write "yield from"'),
        (Worker, {"given": "", "way": "break"}, ValueError, "a bug"),
        (Sly, {"given": ""}, Fault, 'it failed with the undeclared reason "bad"; it declares: none'),
    ],
)  # fmt: skip
def test_what_would_be_refused_or_a_fault_in_a_mission_is_raised(
    fake: FakeCell, skill: type[Skill], inputs: dict[str, str], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        run_skill(skill, fake, inputs=inputs)


def test_a_run_without_a_yield_is_done_at_once(fake: FakeCell) -> None:
    result = run_skill(Plain, fake)
    assert (result.outputs, result.ticks, result.commands) == ({"made": "at once"}, 0, ["tool.open"])


def test_the_commands_of_a_look_are_listed_as_texts(fake: FakeCell, target: Target) -> None:
    look = run_skill(Detect, fake, inputs={"view": "full"})
    assert look.commands == ["camera.capture", "embedded.request frame 2 full"]
    located = run_skill(Localize, fake, inputs={"detections": look.outputs["detections"]})
    assert located.commands == ["ledger.observe 1 found in frame 2"]
    chosen = run_skill(SelectTarget, fake, inputs={"targets": located.outputs["targets"]})
    assert chosen.commands == ["decided cube-1 red_bin"]


def test_the_commands_of_a_pick_are_listed_as_texts(fake: FakeCell, target: Target) -> None:
    approach = run_skill(Approach, fake, inputs={"target": target})
    assert approach.commands == [
        "arm.plan (0.5, 0.0, 0.035)", "arm.start", "arm.stop", "ledger.record_touch cube-1",
    ]  # fmt: skip
    grasp = run_skill(Grasp, fake, inputs={"target": target})
    slot = fake.cell.bins["red_bin"].slots[0]
    over = f"({slot[0]:g}, {slot[1]:g}, 0.065)"
    assert grasp.commands == ["tool.close", "ledger.record_grasp cube-1"]
    transit = run_skill(Transit, fake, inputs={"held": "cube-1", "bin": "red_bin"})
    assert transit.commands == [f"arm.plan {over}", "arm.start", "arm.stop"]
    release = run_skill(Release, fake, inputs={"held": "cube-1", "bin": "red_bin"})
    assert release.commands == ["tool.open", "ledger.record_placement cube-1 red_bin"]


def test_a_named_pose_and_a_question_to_the_operator_are_listed(fake: FakeCell) -> None:
    class GoHome(Skill):
        """Plan to go home, in keywords."""

        def run(self, cell: Any) -> Iterator[None]:
            yield
            assert cell.arm.at_rest and not cell.tool.holding, "questions are no commands"
            cell.arm.plan(goal="home")
            cell.camera.next_pose()

    assert run_skill(GoHome, fake).commands == ["arm.plan home", "camera.next_pose"]
    assert run_skill(AwaitRequest, fake).commands == ["operator.ask"]


def test_a_halt_brakes_the_arm_and_tells_how_long_that_took(fake: FakeCell, target: Target) -> None:
    result = run_skill(Approach, fake, inputs={"target": target}, halt_at=30)
    assert (result.status, result.ticks, result.braking_steps) == ("HALTED", 30, 0)
    assert result.commands == ["arm.plan (0.5, 0.0, 0.035)", "arm.start", "arm.stop"]
    assert fake.arm.at_rest


def test_a_halt_that_leaves_the_arm_in_motion_shows(fake: FakeCell) -> None:
    result = run_skill(Coaster, fake, halt_at=40)
    assert "arm.stop" not in result.commands
    assert result.braking_steps is not None
    assert result.braking_steps > 10
    assert fake.arm.at_rest, "the motion was over by then"


def test_an_arm_that_never_rests_is_not_waited_for(fake: FakeCell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(fake.arm), "at_rest", False)
    result = run_skill(Coaster, fake, halt_at=5)
    assert result.braking_steps is None
    assert fake.cell.clock.now == pytest.approx(5 / 240 + 2.0, abs=0.01)


def test_a_skill_that_does_not_end_is_left_running(fake: FakeCell) -> None:
    result = run_skill(Coaster, fake, max_ticks=400)
    assert (result.status, result.ticks) == ("RUNNING", 400)
