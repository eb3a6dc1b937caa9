"""Whatever a skill needs is on the stage, as often as wanted, or its author puts it there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest
from broken_endings import Scheming
from conforming_skills import Pause, Speed

from executive.cell import Cell, Steps
from executive.discovery import discover
from executive.messages import Bin, Detection, Detections, Frame, Item, ObjectClass, Target
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Seconds, Skill, param, port
from executive.testing.conformance import Stage, conformance
from executive.testing.conformance.checks import nothing_to_add
from executive.testing.conformance.situations import Arrange, NotArranged, Scene, situations


class Everything(Skill):
    """Take whatever there is."""

    target: In[Target] = port(doc="one")
    targets: In[list[Target]] = port(doc="all")
    pair: In[tuple[Target, ...]] = port(doc="all again")
    detections: In[Detections] = port(doc="a look")
    detection: In[Detection] = port(doc="a box")
    frame: In[Frame] = port(doc="an image")
    box: In[Bin] = port(doc="a bin")
    kind: In[ObjectClass] = port(doc="a class")
    item: In[Item] = port(refers="item", doc="a name")
    bin: In[str | None] = port(refers="bin", doc="a name")
    bins: In[list[str]] = port(refers="bin", doc="names")
    label: In[str] = port(refers="class", doc="a name")
    detector: In[str] = port(refers="detector", doc="a name")
    pose: In[str] = port(refers="pose", doc="a name")
    left_out: In[Target | None] = port(default=None, doc="perhaps")
    unknown: In[Speed | None] = port(default=None, doc="perhaps")
    word: str = param(doc="any text")
    number: Seconds = param(ge=0.5, le=2, doc="a time")
    share: float = param(le=0.05, doc="a share [-]")
    many: int = param(ge=3, doc="a count")
    often: bool = param(doc="a truth")
    order: str = param(choices=("rows", "columns"), doc="a choice")
    where: str = param(refers="bin", doc="a name")

    def run(self, cell: Cell) -> Steps:
        """Do nothing with it."""
        yield


def scenes(skill: type[Skill], arrange: Arrange = nothing_to_add) -> list[Scene]:
    return [Scene(skill, situation, arrange) for situation in situations(skill)]


def names(skill: type[Skill]) -> list[str]:
    return [situation.name for situation in situations(skill)]


def test_an_input_of_any_type_that_a_cell_has_is_on_the_stage() -> None:
    values = scenes(Everything)[0].begin()
    (target, *_) = values["targets"]
    assert values["target"] is target
    assert values["pair"] == tuple(values["targets"])
    assert values["detection"] is values["detections"].found[0]
    assert values["frame"] is values["detections"].frame
    assert (values["box"].name, values["kind"].label) == ("red_bin", "cube")
    assert (values["item"], values["label"]) == (target.item, "cube")
    assert (values["bin"], values["bins"]) == ("red_bin", ["red_bin"])
    assert (values["detector"], values["pose"]) == ("embedded", "aside")
    assert "left_out" not in values


def test_a_param_without_default_gets_a_value_that_it_allows() -> None:
    values = scenes(Everything)[0].begin()
    assert {name: values[name] for name in Everything.params} == {
        "word": "some word", "number": 0.5, "share": 0.05, "many": 3, "often": False, "order": "rows",
        "where": "red_bin",
    }  # fmt: skip


def test_inputs_that_may_be_left_out_are_left_out_once_and_given_once() -> None:
    plain, whole = (
        scene.begin()
        for scene in scenes(Everything)
        if scene.situation.name in ("with an empty tool", "with an empty tool and every input given")
    )
    assert "left_out" not in plain
    assert whole["left_out"] is whole["target"]
    assert "unknown" not in whole, "what cannot be made up may be left out"


def test_every_other_choice_is_tried() -> None:
    assert names(discover()["MoveToScan"]) == [
        "with an empty tool",
        "with an item in the tool",
        "with an empty tool and pose: next",
        "with an empty tool and pose: aside",
    ]
    assert "with an empty tool and prefer: surest" in names(discover()["SelectTarget"])


@pytest.mark.parametrize(
    ("needs", "told"),
    [
        (EMPTY, ["with an empty tool"]),
        (HOLDING, ["with an item in the tool"]),
        (ANY, ["with an empty tool", "with an item in the tool"]),
    ],
)
def test_the_tool_holds_what_the_skill_needs(needs: Any, told: list[str]) -> None:
    class Needy(Pause):
        """Wait."""

        tool_state: ClassVar = (needs, ANY)

    found = scenes(Needy)
    assert [scene.situation.name for scene in found] == told
    for scene in found:
        holding = scene.situation.holding
        assert scene.cell.tool.holding == holding
        assert (scene.cell.ledger.in_tool() is not None) == holding


def test_what_a_skill_needs_in_the_tool_is_what_it_is_about() -> None:
    (scene,) = scenes(discover()["Release"])
    values = scene.begin()
    assert values["held"] == scene.cell.ledger.in_tool()
    assert values["bin"] in scene.cell.routes[scene.cell.ledger.label(values["held"])]


def test_what_is_in_the_tool_by_chance_is_not_what_a_skill_is_about() -> None:
    _, holding = scenes(discover()["RejectTarget"])
    assert holding.begin()["item"] != holding.cell.ledger.in_tool()


def test_a_skill_that_has_no_arm_finds_the_cup_on_its_target() -> None:
    scene, *_ = scenes(discover()["Grasp"])
    target = scene.begin()["target"]
    assert scene.cell.tool.touching
    assert np.allclose(scene.cell.arm.tool_pose.position[:2], target.position[:2])


def test_a_scene_begins_the_same_whatever_happened_in_it() -> None:
    scene, *_ = scenes(discover()["SelectTarget"])
    values = scene.begin()
    fake, item = scene.cell, values["targets"][0].item
    values["targets"].clear()
    fake.world.objects.clear()
    fake.ledger.rejected(item, "no reason")
    fake.tool.seals = lambda: False
    fake.advance()
    again = scene.begin()
    assert scene.cell is fake
    assert [target.item for target in again["targets"]] == ["cube-1", "sphere-1", "duck-1"]
    assert len(fake.world.objects) == 3
    assert fake.ledger.is_open(item)
    assert fake.tool.seals()
    assert fake.cell.arm is fake.arm


def with_a_plan(stage: Stage) -> Mapping[str, Any]:
    """Arrange one more cube, and a plan for it."""
    stage.cell.world.put("cube", 0.5, 0.2)
    return {"plan": {"cube": Speed.SLOW}, "words": "go"}


def test_the_author_gives_what_cannot_be_made_up_and_arranges_the_rest() -> None:
    assert {check.verdict().status for check in conformance(Scheming, with_a_plan)} == {"ok"}
    scene, *_ = scenes(Scheming, with_a_plan)
    assert scene.begin() == {"plan": {"cube": Speed.SLOW}, "words": "go"}
    assert len(scene.cell.world.objects) == 4


def test_a_param_that_the_author_gives_has_that_value_only() -> None:
    seen = []

    class Looking(Pause):
        """Wait."""

        view: str = param("table", choices=("table", "full"), doc="which part")
        gap: Metres = param(0.1, doc="how far")

        def run(self, cell: Cell) -> Steps:
            """Note it."""
            seen.append((self.view, self.gap))
            yield

    for check in conformance(Looking, lambda stage: {"view": "full"}):
        check()
    assert set(seen) == {("full", 0.1)}


WRONG: list[tuple[Arrange, str]] = [
    (
        lambda stage: {"plna": {}},
        'what arranges it gives a value for "plna", which is neither a param nor an input; '
        "it has: plan, words",
    ),
    (
        lambda stage: {"plan": stage.nothing},  # type: ignore[attr-defined]
        "what arranges it raised AttributeError: 'Stage' object has no attribute 'nothing'",
    ),
    (
        lambda stage: {"plan": (one for one in ()), "words": ""},
        "the beginning cannot be kept to be repeated: TypeError: cannot pickle 'generator' object. "
        "Give inputs that copy.deepcopy can copy.",
    ),
]


@pytest.mark.parametrize(("arrange", "text"), WRONG)
def test_what_is_arranged_wrongly_is_told(arrange: Arrange, text: str) -> None:
    with pytest.raises(NotArranged) as raised:
        scenes(Scheming, arrange)
    assert str(raised.value) == text
