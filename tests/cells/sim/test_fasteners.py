"""One fastener of each class, picked and placed in the simulated world by the oracle's word."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import SilentOperator
from executive.cells.sim.cell import SimCell
from executive.events import discard_event
from executive.mission.parse.cell_file import load_cell
from executive.skill import Skill
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_skill import SkillResult, run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize
from skills.move_to_scan import MoveToScan
from skills.release import Release
from skills.transit import Transit

ROUTES = {"bolt": ("bolt_bin",), "nut": ("nut_bin",), "washer": ("washer_bin",)}


@pytest.fixture
def with_one(missions: Path, request: pytest.FixtureRequest) -> Callable[..., SimCell]:
    """Build the cell with a single fastener of a class on its table; closed after the test."""

    def with_one(label: str, seed: int) -> SimCell:
        path = missions / "cells" / "fasteners.yaml"
        config = load_cell(path, {"cell.table.objects": "[1, 1]"})
        config = config.model_copy(update={"objects": {label: config.objects[label]}})
        options = CellOptions(SilentOperator(), cell_folder=path.parent)
        made = make_oracle_kind()(
            config, seed=seed, routes={label: ROUTES[label]}, emit=discard_event, options=options
        )
        request.addfinalizer(made.close)
        return made

    return with_one


def done(skill: Skill, made: SimCell) -> SkillResult:
    result = run_skill(skill, made)
    assert (result.status, result.message) == ("SUCCESS", "")
    return result


def seen(made: SimCell):
    done(MoveToScan(), made)
    detections = done(Detect(), made).outputs["detections"]
    return done(Localize(detections=detections), made).outputs["targets"][0]


@pytest.mark.parametrize(("label", "seed"), [("bolt", 1), ("nut", 2), ("washer", 2)])
def test_it_is_picked_at_the_first_attempt_and_lands_in_its_bin(
    with_one: Callable[..., SimCell], label: str, seed: int
) -> None:
    made = with_one(label, seed)
    target = seen(made)
    done(Approach(target=target), made)
    held = done(Grasp(target=target), made).outputs["held"]
    (bin,) = ROUTES[label]
    done(Transit(held=held, bin=bin), made)
    done(Release(held=held, bin=bin), made)
    for _ in range(240):
        made.advance()
    assert made.audit() == {
        "right": 1,
        "wrong_bin": 0,
        "left": 0,
        "elsewhere": 0,
        "fell_in_wrong_bin": 0,
        "unseen": 0,
    }


def test_the_table_felt_through_a_hole_is_no_contact(with_one: Callable[..., SimCell]) -> None:
    made = with_one("washer", 1)
    target = seen(made)
    (body,) = made._world.labels
    # As if the detection had been off by just the ring: the cup comes down in the hole.
    target.position[:2] = made._world.get_object_pose(body).position[:2] - np.array([0.017, 0.0])
    result = run_skill(Approach(target=target), made)
    assert result.reason == "no_contact"
    assert result.message.startswith("no contact down to 3 mm")
