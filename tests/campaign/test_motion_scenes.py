"""The random pairs of the bench of motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from executive.arm import Goal
from executive.campaign.motion_scenes import Scenes
from executive.campaign.motion_trial import opened
from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.goals import approach, into
from executive.layout import as_bin, as_class
from executive.messages import Load, ObjectClass, Obstacle, Target
from executive.mission.parse.cell_file import load_cell
from executive.motion.planner import Planner
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


def alone(config: CellConfig, kind: ObjectClass, lying: int = 0) -> SimpleNamespace:
    """What the goals of skills are made from: a cell with one object, and so many lying in every bin."""
    return SimpleNamespace(
        classes={label: as_class(label, model) for label, model in config.objects.items()},
        bins={name: as_bin(name, bin) for name, bin in config.bins.items()},
        ledger=SimpleNamespace(
            objects_in=lambda bin: lying,
            attempts=lambda item: 0,
            standing=list,
            in_tool=lambda: None,
            label=lambda item: kind.label,
        ),
        descent=config.motion.descent,
        descent_speed=config.motion.descent_speed,
    )


def drops(config: CellConfig, kind: ObjectClass) -> list[Goal]:
    """The goals of transits to every slot of every bin, as long as nothing lies under it."""
    bins = [as_bin(name, bin) for name, bin in config.bins.items()]
    return [
        into(alone(config, kind, lying), bin.name, "it") for bin in bins for lying in range(len(bin.slots))
    ]


def fields(thing: Goal | Obstacle | None) -> list[object]:
    """Everything it says, in one row."""
    assert thing is not None
    values = (value if isinstance(value, tuple) else (value,) for value in astuple(thing))
    return [number for row in values for number in row]


@pytest.mark.parametrize("cell", ["overhead", "fasteners"])
def test_its_goals_are_those_of_the_skills(missions: Path, cell: str) -> None:
    config = load_cell(missions / "cells" / f"{cell}.yaml")
    with opened(config) as (world, planner):
        scenes = Scenes(config, planner, world, seed=1)
        for _ in range(4):
            scene = scenes.next()
            it, kind = scene.target, scene.kind
            middle = it.top - kind.height / 2
            assert middle == pytest.approx(kind.height / 2, abs=2e-3), "it stands on the table"
            target = Target(it.name, kind.label, np.array([it.x, it.y, middle]), 1.0, 0, 0, 0.0)
            goal, task = approach(alone(config, kind), target)
            assert fields(scene.approach) == pytest.approx(fields(goal), abs=1e-9)
            assert fields(scene.fetching.target) == pytest.approx(fields(task.target), abs=1e-9)
            assert scene.place == scene.approach.position[:2]
            assert scene.drop in drops(config, kind)
            assert scene.carrying(3.0).load == Load(kind, 3.0)
        tallest = max(alone(config, kind).classes.values(), key=lambda kind: kind.height)
        assert scenes.resting_place() in drops(config, tallest)


def test_what_it_carries_weighs_what_the_object_does(missions: Path) -> None:
    config = load_cell(missions / "cells" / "fasteners.yaml")
    masses = {}
    with opened(config) as (world, planner):
        scenes = Scenes(config, planner, world, seed=0)
        while len(masses) < len(config.objects):
            scene = scenes.next()
            load = scene.carrying(scene.bears).load
            masses[scene.kind.label] = load.kind.mass
            assert load.kind.mass == pytest.approx(world.client.getDynamicsInfo(scene.body, -1)[0])
    assert masses["washer"] == 0.03


def test_a_cell_whose_objects_no_cup_holds_has_no_scenes(room, overhead):
    world, planner = room
    weak = overhead.model_copy(update={"tool": overhead.tool.model_copy(update={"force": 0.5})})
    with pytest.raises(InputError, match=r"none of 50 random scenes of cell overhead .* bears 0\.\d N"):
        Scenes(weak, planner, world, seed=0).next()
