"""The least time in which each skill can succeed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from executive.plugins import load_skills
from executive.skill import Skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.move_to_scan import MoveToScan
from skills.put_down import PutDown
from skills.release import Release
from skills.transit import Transit
from skills.wait import Wait


class Least:
    """A cell in which everything takes another time."""

    descent_time = 0.3

    def get_transport_time(self, bin: str | None) -> float:
        return {None: 0.5, "red_bin": 0.7}[bin]

    def get_answer_time(self, detector: str) -> float:
        return {"": 0.05, "slow": 2.0}[detector]


SHORTEST: list[tuple[type[Skill], Mapping[str, Any], float]] = [
    (Approach, {}, 0.3),
    (Detect, {}, 0.05),
    (Detect, {"detector": "slow"}, 2.0),
    (Grasp, {"settle": 0.2}, 0.2),
    (MoveToScan, {"pose": "home"}, 0.0),
    (PutDown, {"settle": 0.3}, 0.3),
    (Release, {"settle": 0.4}, 0.4),
    (Transit, {}, 0.5),
    (Transit, {"bin": "red_bin"}, 0.7),
    (Wait, {"seconds": 3}, 3.0),
    (Wait, {}, 0.0),
]


def defaults(skill: type[Skill]) -> dict[str, Any]:
    """Return what is known of a skill that a mission says nothing about."""
    return {name: param.default for name, param in skill.params.items() if not param.is_required}


@pytest.mark.parametrize(("skill", "given", "seconds"), SHORTEST)
def test_the_least_time_follows_from_cell_and_params(
    skill: type[Skill], given: Mapping[str, Any], seconds: float
) -> None:
    assert skill.min_time(Least(), {**defaults(skill), **given}) == seconds


@pytest.mark.parametrize("skill", load_skills().values())
def test_every_skill_can_be_asked_with_nothing_but_its_defaults(skill: type[Skill]) -> None:
    assert skill.min_time(Least(), defaults(skill)) >= 0.0
