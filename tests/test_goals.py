"""Where something is put down: on the safe place, or beside what stands there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.goals import SIDE_BY_SIDE, aside
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.localize import Localize
from skills.put_down import PutDown

SAFE = (0.45, -0.30)


@pytest.fixture
def held(fake: FakeCell) -> str:
    """A cube in the tool."""
    return picked(fake, fake.world.put("cube", 0.5, 0.0).label)


def picked(fake: FakeCell, label: str) -> str:
    """Pick the first object of that class that a look shows in the workspace; return its item."""
    detections = run_skill(Detect(view="full"), fake).outputs["detections"]
    targets = run_skill(Localize(detections=detections), fake).outputs["targets"]
    target = next(one for one in targets if one.label == label and one.position[1] > -0.2)
    run_skill(Approach(target=target), fake)
    return run_skill(Grasp(target=target, bin="red_bin"), fake).outputs["held"]


def test_it_is_the_safe_place_if_that_is_free(fake: FakeCell, held: str) -> None:
    assert aside(fake.cell, held, 0.01).position == pytest.approx((*SAFE, 0.05 + 0.01))


def test_what_is_put_down_one_after_another_stands_side_by_side(fake: FakeCell, held: str) -> None:
    places = []
    item = held
    for _ in range(4):
        run_skill(PutDown(held=item), fake)
        places.append(tuple(next(row for row in fake.ledger.rows() if row["item"] == item)["position"][:2]))
        fake.world.put("cube", 0.5, 0.1)
        item = picked(fake, "cube")
    assert places[0] == pytest.approx(SAFE)
    radius = fake.cell.classes["cube"].radius
    gaps = [math.dist(a, b) for n, a in enumerate(places) for b in places[:n]]
    assert min(gaps) >= 2 * radius + SIDE_BY_SIDE - 1e-6
    assert max(math.dist(place, SAFE) for place in places) < 0.2
    assert not any(bin.contains(place) for place in map(np.array, places) for bin in fake.cell.bins.values())


def test_where_nothing_is_free_it_is_the_safe_place_all_the_same(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.goals.ROWS", 0)
    run_skill(PutDown(held=held), fake)
    fake.world.put("cube", 0.5, 0.1)
    assert aside(fake.cell, picked(fake, "cube"), 0.01).position[:2] == pytest.approx(SAFE)
