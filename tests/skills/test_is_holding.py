"""IsHolding: the sensor decides."""

from __future__ import annotations

import numpy as np

from executive.messages import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.is_holding import IsHolding
from skills.localize import Localize


def held(fake: FakeCell) -> Target:
    """Put a cube into the tool and return its target."""
    fake.world.put("cube", 0.5, 0.1)
    detections = run_skill(Detect(), fake).outputs["detections"]
    (target,) = run_skill(Localize(detections=detections), fake).outputs["targets"]
    assert run_skill(Approach(target=target), fake).status == "SUCCESS"
    assert run_skill(Grasp(target=target), fake).status == "SUCCESS"
    return target


def test_it_names_what_the_tool_holds(fake: FakeCell) -> None:
    target = held(fake)
    result = run_skill(IsHolding(), fake)
    assert (result.status, result.outputs) == ("SUCCESS", {"held": target.item})


def test_an_empty_tool_is_told_as_such(fake: FakeCell) -> None:
    result = run_skill(IsHolding(), fake)
    assert (result.status, result.reason, result.message) == ("FAILURE", "empty", "the sensor feels no seal")


def test_what_should_be_in_the_tool_and_is_not_was_dropped(fake: FakeCell) -> None:
    target = held(fake)
    fake.tool.open()
    result = run_skill(IsHolding(), fake)
    assert result.message == f"the sensor feels no seal; {target.item} was dropped"
    assert fake.ledger.in_tool() is None
    assert fake.ledger.is_open(target.item)
    assert np.isclose(fake.ledger.attempts(target.item), 1)
