"""The random pairs of the bench of motion."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from executive.campaign.motion_scenes import Scenes
from executive.campaign.motion_trial import opened
from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.layout import as_bin
from executive.messages import Target
from executive.motion.planner import Planner
from executive.moving import approach
from executive.sim.world import World


@pytest.fixture
def room(overhead: CellConfig) -> Iterator[tuple[World, Planner]]:
    with opened(overhead) as room:
        yield room


def test_a_scene_is_what_a_run_could_begin_with_and_the_seed_decides_it(room, overhead):
    world, planner = room
    scenes = Scenes(overhead, planner, world, seed=4)
    first = scenes.next()
    assert world.bodies[first.body] == first.kind.label
    assert 3 <= len(world.bodies) == 1 + len(first.others) <= 6
    second = scenes.next()
    again = Scenes(overhead, planner, world, seed=4)
    assert [again.next().approach, again.next().approach] == [first.approach, second.approach]
    assert first.approach != second.approach


def test_its_goals_are_those_of_the_skills(room, overhead):
    world, planner = room
    scene = Scenes(overhead, planner, world, seed=1).next()
    x, y = scene.place
    target = Target("it", scene.kind.label, np.array([x, y, scene.kind.height / 2]), 1.0, 0, 0, 0.0)
    cell = SimpleNamespace(
        classes={scene.kind.label: scene.kind},
        bins={name: as_bin(name, bin) for name, bin in overhead.bins.items()},
        routes={},
        ledger=SimpleNamespace(
            objects_in=lambda bin: 0,
            attempts=lambda item: 0,
            standing=list,
            in_tool=lambda: None,
            label=lambda item: scene.kind.label,
        ),
        descent=overhead.motion.descent,
        descent_speed=overhead.motion.descent_speed,
    )
    goal, task = approach(cell, target)
    assert scene.approach.position == pytest.approx(goal.position, abs=1e-3)
    assert (scene.approach.guarded, scene.approach.speed) == pytest.approx(
        (goal.guarded, goal.speed), abs=1e-3
    )
    slots = [tuple(slot) for bin in cell.bins.values() for slot in bin.slots]
    assert scene.drop.position[:2] in slots
    assert task.target is not None and scene.fetching.target is not None
    assert scene.fetching.target.top == pytest.approx(task.target.top, abs=1e-3)
    assert scene.carrying(3.0).load.bears == 3.0


def test_a_cell_whose_objects_no_cup_holds_has_no_scenes(room, overhead):
    world, planner = room
    weak = overhead.model_copy(update={"tool": overhead.tool.model_copy(update={"force": 0.5})})
    with pytest.raises(InputError, match=r"none of 50 random scenes of cell overhead .* bears 0\.\d N"):
        Scenes(weak, planner, world, seed=0).next()
