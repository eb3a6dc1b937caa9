"""The audit where it could count wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from executive.drivers.sim.cell import list_final_objects

from executive.cell.devices import TrueObject
from executive.cell.objects import UNKNOWN_LABEL, Bin
from executive.geometry import Pose
from executive.station.station import AUDIT_KEYS, count_outcomes

IN_BIN, ON_TABLE, ON_FLOOR = (0.2, -0.44, 0.12), (0.5, 0.0, 0.025), (1.4, 0.0, -0.6)
NONE = dict.fromkeys(AUDIT_KEYS, 0)
ITEM = SimpleNamespace(state=None, first_position=np.array(ON_TABLE))


class OneBody:
    """A world with one body, by default a cube over the bin."""

    def __init__(self, label: str = "cube", place: Sequence[float] = IN_BIN) -> None:
        self.removed_objects: dict[int, TrueObject] = {}
        self.rest_positions = {7: [np.array([0.5, 0.0, 0.025])]}
        self._object = TrueObject(label, Pose.of(place))

    def describe_object(self, body: int) -> TrueObject:
        return self._object


def counted(bins_of_cube: tuple[str, ...], world: OneBody | None = None, **more: Any) -> dict[str, int]:
    bins = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}
    records = more.pop("records", [])
    tool: Any = SimpleNamespace(**{"held_body": None, "dropped_bodies": set(), **more})
    objects = list_final_objects(world or OneBody(), tool, bins)  # type: ignore[arg-type]
    return count_outcomes(objects, records, bins, {"cube": bins_of_cube}, max_distance=0.025)


RED = ("red_bin",)
BLUE = ("blue_bin",)
DROPPED = {"dropped_bodies": {7}}


@pytest.mark.parametrize(
    ("bins", "place", "more", "end"),
    [
        (RED, IN_BIN, {}, {"right": 1}),
        (("blue_bin", "red_bin"), IN_BIN, {}, {"right": 1}),
        (BLUE, IN_BIN, {}, {"wrong_bin": 1}),
        (RED, IN_BIN, {"held_body": 7}, {"left": 1}),
        (BLUE, IN_BIN, DROPPED, {"elsewhere": 1, "fell_in_wrong_bin": 1}),
        (RED, IN_BIN, DROPPED, {"right": 1}),
    ],
)
def test_a_body_counts_by_its_class_and_by_who_put_it_there(bins, place, more, end: dict[str, int]) -> None:
    assert counted(bins, OneBody(place=place), **more) == {**NONE, "unseen": 1, **end}


@pytest.mark.parametrize(
    ("bins", "place", "more", "end"),
    [
        (RED, IN_BIN, {}, "right"),
        (BLUE, IN_BIN, {}, "wrong_bin"),
        (RED, IN_BIN, DROPPED, "elsewhere"),
        (RED, ON_TABLE, {}, "elsewhere"),
    ],
)
def test_a_removed_body_counts_as_if_it_still_lay_there_if_it_was_seen(bins, place, more, end: str) -> None:
    world = OneBody()
    world.removed_objects[7] = TrueObject("cube", Pose.of(place), is_removed=True)
    assert counted(bins, world, records=[ITEM], **more) == {**NONE, end: 1}
    assert counted(bins, world, **more) == NONE


@pytest.mark.parametrize(
    ("place", "records", "end"),
    [
        (ON_TABLE, [], {}),
        (ON_FLOOR, [], {}),
        (IN_BIN, [], {"wrong_bin": 1}),
        (ON_TABLE, [ITEM], {"left": 1}),
        (ON_FLOOR, [ITEM], {"elsewhere": 1}),
    ],
)
def test_an_unknown_object_counts_if_it_was_seen_or_is_in_a_bin(place, records, end: dict[str, int]) -> None:
    assert counted(RED, OneBody(UNKNOWN_LABEL, place), records=records) == {**NONE, **end}
