"""The situations of a skill, what is on the scene there, and when it is halted."""

from __future__ import annotations

from typing import Any

import faulty_skills as faulty
import pytest

from executive.cell.detection import Detections
from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.plugins import load_skills
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Seconds, Skill, param, port
from executive.testing.conformance import SkillScene
from executive.testing.conformance.conformance_check import keep_scene
from executive.testing.conformance.situations import (
    Arrange,
    ArrangementFailed,
    Situation,
    list_situations,
    prepare_scene,
)
from executive.testing.conformance.skill_runs import MAX_HALTS, SkillRuns


class Everything(Skill):
    """Take whatever there is."""

    target: In[Target] = port(doc="one")
    targets: In[list[Target]] = port(doc="all")
    detections: In[Detections] = port(doc="a look")
    item: In[Item] = port(refers_to="item", doc="a name")
    bin: In[str | None] = port(refers_to="bin", doc="a name")
    label: In[str] = port(refers_to="class", doc="a name")
    pose: In[str] = port(refers_to="pose", doc="a name")
    left_out: In[Target | None] = port(default=None, doc="perhaps")
    unknown: In[dict[str, int] | None] = port(default=None, doc="perhaps")
    word: str = param(doc="any text")
    number: Seconds = param(ge=0.5, le=2, doc="a time")
    share: float = param(le=0.05, doc="a share [-]")
    free: Metres = param(doc="a length")
    many: int = param(ge=3, doc="a count")
    often: bool = param(doc="a truth")
    order: str = param(choices=("rows", "columns"), doc="a choice")
    where: str = param(refers_to="detector", doc="a name")

    def run(self, cell: Cell) -> Steps:
        """Do nothing with it."""
        yield


def names(skill: type[Skill], arrange: Arrange = keep_scene) -> list[str]:
    return [situation.name for situation in list_situations(skill, arrange)]


def values_of(skill: type[Skill], situation: Situation) -> dict[str, Any]:
    return prepare_scene(skill, situation, keep_scene)[1]


def test_what_a_skill_needs_is_made_up() -> None:
    scene, values = prepare_scene(Everything, Situation("", False), keep_scene)
    assert [target.label for target in scene.targets] == ["cube", "sphere", "duck"]
    assert values["targets"] == scene.targets and values["targets"] is not scene.targets
    assert (values.pop("target"), values.pop("targets")[0]) == (scene.targets[0], scene.targets[0])
    assert values.pop("detections") is scene.detections
    assert values == {
        "item": scene.item, "bin": "red_bin", "label": "cube", "pose": "aside", "word": "some word",
        "number": 0.5, "share": 0.05, "free": 0.1, "many": 3, "often": False, "order": "rows",
        "where": "embedded",
    }  # fmt: skip
    whole = values_of(Everything, Situation("", False, has_all_inputs=True))
    assert whole["left_out"] is whole["target"]
    assert "unknown" not in whole, "an input that cannot be made up may be left out"


def test_a_skill_is_tried_in_every_situation_that_it_may_begin_in() -> None:
    assert names(load_skills()["MoveToScan"]) == [
        "with an empty tool",
        "with an item in the tool",
        "with an empty tool and pose: next",
        "with an empty tool and pose: aside",
    ]
    assert names(load_skills()["Grasp"]) == ["with an empty tool"]
    assert names(Everything)[:3] == [
        "with an empty tool", "with an item in the tool", "with an empty tool and all inputs given",
    ]  # fmt: skip
    given = names(load_skills()["MoveToScan"], lambda scene: {"pose": "home"})
    assert given == ["with an empty tool", "with an item in the tool"], "a param that is given is not varied"


@pytest.mark.parametrize(("needs", "held"), [(EMPTY, [False]), (HOLDING, [True]), (ANY, [False, True])])
def test_the_tool_holds_what_the_skill_needs(needs: Any, held: list[bool]) -> None:
    skill = type("Needy", (faulty.Pause,), {"tool_state": (needs, ANY), "__annotations__": {}})
    found = list(list_situations(skill, keep_scene))
    assert [situation.is_holding for situation in found] == held
    for situation in found:
        scene, _ = prepare_scene(skill, situation, keep_scene)
        assert scene.cell.tool.holding is situation.is_holding
        assert (scene.cell.ledger.find_held_item() is not None) is situation.is_holding
        assert (scene.item == scene.cell.ledger.find_held_item()) is (needs is HOLDING)


def test_a_skill_without_arm_finds_the_cup_on_its_target() -> None:
    for name, touches in (("Grasp", True), ("Approach", False)):
        scene, _ = prepare_scene(load_skills()[name], Situation("", False), keep_scene)
        assert scene.cell.tool.touching is touches


def broken(scene: SkillScene) -> dict[str, Any]:
    raise KeyError("cube")


@pytest.mark.parametrize(
    ("state", "arrange", "text"),
    [
        ("empty", keep_scene, "its tool_state is 'empty'; it must begin with ANY, EMPTY or HOLDING"),
        ((), keep_scene, "its tool_state is (); it must begin with ANY, EMPTY or HOLDING"),
        ((EMPTY, EMPTY), broken, "the function `arrange` raised KeyError: 'cube'"),
    ],
)
def test_a_skill_without_a_situation_has_a_cause(state: Any, arrange: Arrange, text: str) -> None:
    skill = type("Odd", (faulty.Pause,), {"tool_state": state, "__annotations__": {}})
    with pytest.raises(ArrangementFailed) as raised:
        names(skill, arrange)
    assert str(raised.value) == text


class Patient(faulty.Pause):
    """Wait for long, and ask a question in between."""

    def run(self, cell: Cell) -> Steps:
        """Wait."""
        for step in range(400):
            if step == 201:
                cell.camera.get_view_box("table")
            yield


def test_a_skill_is_halted_at_its_calls_and_now_and_then() -> None:
    short = SkillRuns("Pause", faulty.Pause, keep_scene)
    assert [test_run.ticks for test_run in short.halted_runs] == [1, 2, 1, 2]
    ticks = [test_run.ticks for test_run in SkillRuns("Patient", Patient, keep_scene).halted_runs]
    assert {1, 201, 202, 400} <= set(ticks)
    assert MAX_HALTS <= len(set(ticks)) <= MAX_HALTS + 2
