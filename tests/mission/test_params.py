"""Params of a mission: types, bounds, choices, and values given beside the file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from executive.mission.load import LoadedMission
from executive.text.findings import MissionError

Load = Callable[..., LoadedMission]

TREE = "tree: {repeat: {times: $n, do: Look}}\n"


def mission(param: str) -> str:
    return f"mission: m\ncell: cells/small.yaml\nparams: {{n: {param}}}\n{TREE}"


@pytest.mark.parametrize(
    ("param", "given", "value"),
    [
        ("3", None, 3), ("3", "5", 5), ("{type: integer}", "4", 4),
        ("{default: 3, min: 1, max: 5, doc: how often}", "5", 5),
        ("{default: 3, choices: [3, 6]}", "6", 6),
    ],
)  # fmt: skip
def test_a_param_has_its_default_or_what_is_given(
    load: Load, param: str, given: str | None, value: Any
) -> None:
    assert load(mission(param), {"n": given} if given else None).params == {"n": value}


@pytest.mark.parametrize(
    ("param", "given", "finding"),
    [
        ("{default: 0, min: 1}", None, "m.yaml:3:23: error[out-of-range]: n must be at least 1, not 0"),
        ("{default: 3, max: 5}", "6", "--set:1:3: error[out-of-range]: n must be at most 5, not 6"),
        ("{default: 3, choices: [3, 6]}", "4", "--set:1:3: error[wrong-value]: n must be 3 or 6"),
        (
            "{type: integer}",
            None,
            'm.yaml:3:10: error[missing-param]: the param "n" has neither a default nor a value',
        ),
        ("{default: 3, type: int}", None, 'm.yaml:3:32: error[wrong-value]: there is no type "int"'),
        ("{default: 3, min: low}", None, 'm.yaml:3:31: error[wrong-type]: min of the param "n" must be a'),
        ("{default: 3, least: 1}", None, 'm.yaml:3:26: error[unknown-key]: the param "n" has no key'),
    ],
)
def test_a_wrong_param_is_a_finding(load: Load, param: str, given: str | None, finding: str) -> None:
    with pytest.raises(MissionError) as caught:
        load(mission(param), {"n": given} if given else None)
    assert str(caught.value).startswith(finding)
