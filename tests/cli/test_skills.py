"""`executive skills`: what the installed skills declare, as text and as JSON."""

from __future__ import annotations

import json
from enum import Enum
from typing import ClassVar

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Out, Skill, param, port


class Speed(Enum):
    """How fast."""

    SLOW = "slow"


class PlaceNeatly(Skill):
    """Put the item down in line with the others.

    Succeeds when the tool is empty.
    """

    held: In[str] = port(refers_to="item", doc="what to put down")
    beside: In[list[str] | None] = port(default=None, doc="what it goes beside")
    placed: Out[str] = port(doc="what was put down")
    gap: Metres = param(0.01, ge=0, le=0.05, doc="between two items")
    bin: str = param(refers_to="bin", doc="where")
    order: str = param("rows", choices=("rows", "columns"), doc="word " * 30)
    speed: Speed = param(Speed.SLOW, doc="how fast")
    limit: float = param(float("inf"), doc="how far")
    reasons: ClassVar = ("full", "stuck")
    uses: ClassVar = ("arm", "tool")
    senses: ClassVar = True
    moves: ClassVar = True
    tool_state: ClassVar = (HOLDING, EMPTY)
    tool_state_after_failure: ClassVar = {"halt": ANY}


class Rest(Skill):
    """Do nothing."""


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    skills = {"PlaceNeatly": PlaceNeatly, "Rest": Rest}
    monkeypatch.setattr("executive.behaviours.load_skills", lambda: skills)


def shown(*words: str) -> Result:
    return invoke("skills", *words)


def test_json_tells_everything_of_one_skill_as_one_object_and_of_all_as_one_array():
    printed = json.loads(shown("PlaceNeatly", "--json").stdout)
    params, ports = printed.pop("params"), printed.pop("ports")
    assert printed == {
        "name": "PlaceNeatly",
        "doc": "Put the item down in line with the others.\n\nSucceeds when the tool is empty.",
        "reasons": ["full", "stuck"], "uses": ["arm", "tool"], "senses": True, "moves": True,
        "is_condition": False,
        "tool": {"before": "holding", "after": "empty", "left": {"halt": "any"}},
    }  # fmt: skip
    assert params[0] == {
        "name": "gap", "type": "float", "unit": "m", "required": False, "default": 0.01, "min": 0,
        "max": 0.05, "choices": None, "refers": "", "doc": "between two items", "candidate": "",
    }  # fmt: skip
    assert [tuple(one[key] for key in ("required", "default", "refers", "choices")) for one in params] == [
        (False, 0.01, "", None), (True, None, "bin", None), (False, "rows", "", ["rows", "columns"]),
        (False, "slow", "", None), (False, "Infinity", "", None),
    ]  # fmt: skip
    assert ports[0] == {
        "name": "held", "type": "str", "direction": "in", "required": True, "default": None,
        "refers": "item", "doc": "what to put down",
    }  # fmt: skip
    assert [(port["name"], port["type"], port["direction"], port["required"]) for port in ports[1:]] == [
        ("beside", "list[str] | None", "in", False), ("placed", "str", "out", False),
    ]  # fmt: skip
    assert [skill["name"] for skill in json.loads(shown("--json").stdout)] == ["PlaceNeatly", "Rest"]


def test_the_text_tells_the_same():
    text = shown("PlaceNeatly").stdout
    for line in (
        "  held: str, required, names an item. what to put down",
        "  beside: list[str] | None, optional. what it goes beside",
        "  placed: str. what was put down",
        "  gap: float [m], default 0.01, at least 0, at most 0.05. between two items",
        "  bin: str, required, names a bin. where",
        "may fail with: full, stuck",
        "uses: arm, tool; senses; moves the arm",
        "tool: holding before, empty after, any after halt",
    ):
        assert line in text.splitlines()
    assert max(map(len, text.splitlines())) <= 100
