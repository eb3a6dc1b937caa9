"""The conformance checks: what each rule finds in a skill with a mistake, and that shipped skills conform."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import pytest
from at_hand import look

from executive.behaviours import load_skills
from executive.cell.arm import Goal
from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.geometry import Yaw
from executive.manipulation.motions import follow, make_task, plan
from executive.mission.cell_file import load_cell
from executive.skill import EMPTY, HOLDING, In, Metres, Out, Skill, param, port
from executive.testing.conformance import RULES, SkillScene, list_conformance_checks
from executive.text.files import find_cell


class Push(Skill):
    """Push the target aside."""

    target: In[Target] = port(doc="what to push")
    height: Metres = param(0.05, ge=0.0, le=0.2, doc="above the target's middle")
    reasons: ClassVar = ("unreachable", "blocked")
    uses: ClassVar = ("arm",)
    moves: ClassVar = True
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        x, y, z = (float(value) for value in self.target.position)
        motion = yield from plan(self, cell.arm, lambda: (Goal((x, y, z + self.height)), make_task(cell)))
        yield from follow(self, cell, motion)


class RunOn(Push):
    """Push the target, also after a halt."""

    def run(self, cell: Cell) -> Steps:
        motion = yield from plan(self, cell.arm, lambda: ("aside", make_task(cell)))
        cell.arm.start(motion)
        while not cell.arm.at_rest:
            yield


class Pause(Skill):
    """Wait for two control steps."""

    reasons: ClassVar = ("tired",)
    tool_state: ClassVar = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        yield
        yield


class AlwaysFail(Pause):
    """Fail at the start."""

    def run(self, cell: Cell) -> None:
        raise self.failure("tired", "after 0 steps")


class WaitForEver(Pause):
    """Wait without a limit."""

    def run(self, cell: Cell) -> Steps:
        while True:
            yield


class TrustDetector(Skill):
    """Expect a detection in every image."""

    uses: ClassVar = ("camera",)
    senses: ClassVar = True

    def run(self, cell: Cell) -> Steps:
        request = next(iter(cell.detectors.values())).request(cell.camera.capture(), "table")
        while not request.ready:
            yield
        _ = request.result().confident[0]


class ChooseNumber(Pause):
    """Choose values of wrong types."""

    targets: Out[list[Target]] = port(doc="what there is")
    chosen: Out[Item] = port(refers_to="item", doc="what was chosen")
    length: Out[float | None] = port(doc="an allowed value")

    def run(self, cell: Cell) -> None:
        self.targets = ["cube-1"]  # type: ignore[list-item]
        self.chosen = 3  # type: ignore[assignment]
        self.length = 1


class ChangeInput(Pause):
    """Change a list that belongs to the caller."""

    targets: In[list[Target]] = port(doc="what there is")

    def run(self, cell: Cell) -> None:
        self.targets.pop(0)


class UseSecretly(Skill):
    """Use devices without a declaration."""

    def run(self, cell: Cell) -> None:
        cell.camera.capture()
        cell.operator.ask(())


class ChangeBelief(Skill):
    """Change the ledger in a condition."""

    is_condition: ClassVar = True

    def run(self, cell: Cell) -> None:
        cell.ledger.invalidate_positions()


class LetGo(Skill):
    """Open the tool, against the declaration."""

    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (HOLDING, HOLDING)

    def run(self, cell: Cell) -> None:
        cell.tool.open()


class GraspSecretly(Skill):
    """Grasp the target without a record in the ledger."""

    target: In[Target] = port(doc="what the tool touches")
    reasons: ClassVar = ("missed",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (EMPTY, HOLDING)

    def run(self, cell: Cell) -> None:
        cell.tool.close()
        if not cell.tool.holding:
            raise self.failure("missed", "no seal")


class NeedWords(Pause):
    """Need a text that nobody can guess."""

    words: In[str] = port(doc="what to say")


FAULTY = [
    (AlwaysFail, "can_succeed", "AlwaysFail never succeeded; with an empty tool: FAILURE at tick 0 tired"),
    (NeedWords, "leaves_arm_at_rest", r'no value can be generated for "words" \(a text\)'),
    (WaitForEver, "ends_as_declared", "RUNNING at tick 14400. Limit the duration of each wait"),
    (TrustDetector, "ends_as_declared", "while nothing is detected: FAULT at tick 12  IndexError"),
    (ChooseNumber, "has_outputs_of_declared_types", r"targets is \['cube-1'\], not a list of Target"),
    (ChangeInput, "leaves_inputs_unchanged", "an input has changed"),
    (UseSecretly, "uses_only_declared_parts", "camera.capture and does not declare the camera"),
    (ChangeBelief, "uses_only_declared_parts", "ledger.invalidate_positions, and declares is_condition"),
    (LetGo, "leaves_tool_as_declared", "SUCCESS at tick 0, and the tool is empty"),
    (GraspSecretly, "leaves_tool_as_declared", "the ledger knows no held item"),
    (RunOn, "leaves_arm_at_rest", r"HALTED at tick \d+, and the arm still moves"),
]
"""Skill with a mistake, rule, and a part of the message."""


@pytest.mark.parametrize(("skill", "rule", "text"), FAULTY)
def test_a_mistake_is_reported(skill: type[Skill], rule: str, text: str) -> None:
    (check,) = (check for check in list_conformance_checks(skill) if check.rule.__name__ == rule)
    with pytest.raises(AssertionError, match=f"(?s){check.rule.__doc__}.*Violated:.*{text}"):
        check()


def test_every_rule_is_violated_by_a_skill() -> None:
    assert {rule for _, rule, _ in FAULTY} == {rule.__name__ for rule in RULES}


@pytest.mark.parametrize("check", list_conformance_checks(Push), ids=str)
def test_nothing_is_found_in_a_skill_that_conforms(check: Any) -> None:
    check()


def test_the_author_arranges_the_scene_and_gives_values() -> None:
    def arrange(scene: SkillScene) -> dict[str, Any]:
        scenes.append((scene.cell.tool.holding, len(scene.targets), scene.item))
        return {"words": "hello"}

    scenes: list[tuple[bool, int, Item]] = []
    for check in list_conformance_checks(NeedWords, arrange, name="Say"):
        check()
    assert str(check) == f"Say.{RULES[-1].__name__}"
    assert set(scenes) == {(False, 3, "cube-1")}


QUICK = ("Grasp", "Release", "SelectTarget")
"""Shipped skills that are tried in the default tier; the others take seconds."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in load_skills()]
)
def test_every_shipped_skill_conforms(name: str) -> None:
    arrange = {"Push": arrange_push}.get(name, lambda _: {})
    for check in list_conformance_checks(load_skills()[name], arrange, name=name):
        check()


def arrange_push(scene: SkillScene) -> dict[str, Any]:
    """Replace the cup by fingers that have no space beside the target."""
    fake = scene.cell
    fake.tool.model = load_cell(find_cell("iiwa_wsg50")).tool
    fake.cell = replace(fake.cell, tool_model=fake.tool.model)
    x, y = scene.targets[0].position[:2]
    for sign in (1, -1):
        fake.world.put("sphere", x + sign * 0.044, y + sign * 0.044)
    return {"target": replace(look(fake)[0], yaw=Yaw(0.0, 0.01, 4))}
