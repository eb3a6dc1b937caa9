"""The audit where it could count wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.bins import Bin
from executive.cell.workcell import AUDIT_KEYS
from executive.cells.ground_truth import UNKNOWN_LABEL, count_outcomes
from executive.cells.sim.cell import list_final_objects
from executive.geometry import Pose

IN_BIN, ON_TABLE, ON_FLOOR = (0.2, -0.44, 0.12), (0.5, 0.0, 0.025), (1.4, 0.0, -0.6)


class OneBody:
    """A world with one body, by default a cube over the bin."""

    def __init__(self, label: str = "cube", place: Sequence[float] = IN_BIN) -> None:
        self.labels = {7: label}
        self.removed_objects: dict[int, tuple[str, np.ndarray]] = {}
        self.rest_positions = {7: [np.array([0.5, 0.0, 0.025])]}
        self._place = place

    def get_object_pose(self, body: int) -> Pose:
        return Pose.of(self._place)


def counted(bins_of_cube: tuple[str, ...], world: OneBody | None = None, **more: Any) -> dict[str, int]:
    bins = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}
    records = more.pop("records", [])
    tool: Any = SimpleNamespace(**{"held_body": None, "dropped_bodies": set(), **more})
    objects = list_final_objects(world or OneBody(), tool, bins)  # type: ignore[arg-type]
    return count_outcomes(objects, records, bins, {"cube": bins_of_cube}, max_distance=0.025)


@pytest.mark.parametrize(
    ("bins", "more", "end"),
    [
        (("red_bin",), {}, "right"),
        (("blue_bin", "red_bin"), {}, "right"),
        (("blue_bin", "grey_bin"), {}, "wrong_bin"),
        (("red_bin",), {"held_body": 7}, "left"),
        (("blue_bin",), {"dropped_bodies": {7}}, "elsewhere"),
        (("red_bin",), {"dropped_bodies": {7}}, "right"),
    ],
)
def test_a_body_in_a_bin_counts_by_its_class_and_by_who_put_it_there(
    bins: tuple[str, ...], more: dict[str, Any], end: str
) -> None:
    none = {"right": 0, "wrong_bin": 0, "left": 0, "elsewhere": 0, "fell_in_wrong_bin": 0, "unseen": 1}
    fell = bins == ("blue_bin",) and "dropped_bodies" in more
    assert counted(bins, **more) == {**none, end: 1, "fell_in_wrong_bin": int(fell)}


@pytest.mark.parametrize(
    ("bins", "place", "more", "end"),
    [
        (("red_bin",), IN_BIN, {}, "right"),
        (("blue_bin",), IN_BIN, {}, "wrong_bin"),
        (("red_bin",), IN_BIN, {"dropped_bodies": {7}}, "elsewhere"),
        (("red_bin",), ON_TABLE, {}, "elsewhere"),
    ],
)
def test_a_body_that_was_taken_out_of_a_bin_counts_as_if_it_still_lay_there(
    bins: tuple[str, ...], place: Sequence[float], more: dict[str, Any], end: str
) -> None:
    world = OneBody()
    world.removed_objects[7] = (world.labels.pop(7), np.array(place))
    item = SimpleNamespace(state=None, first_position=np.array(ON_TABLE))
    assert counted(bins, world, records=[item], **more) == {**dict.fromkeys(AUDIT_KEYS, 0), end: 1}
    assert counted(bins, world, **more) == dict.fromkeys(AUDIT_KEYS, 0), "nobody had seen it"


@pytest.mark.parametrize(
    ("place", "claimed", "end"),
    [
        (ON_TABLE, False, {}),
        (ON_FLOOR, False, {}),
        (IN_BIN, False, {"wrong_bin": 1}),
        (ON_TABLE, True, {"left": 1}),
        (ON_FLOOR, True, {"elsewhere": 1}),
        (IN_BIN, True, {"wrong_bin": 1}),
    ],
)
def test_an_unknown_object_counts_if_an_item_stands_for_it_or_if_it_is_in_a_bin(
    place: Sequence[float], claimed: bool, end: dict[str, int]
) -> None:
    items = [SimpleNamespace(state=None, first_position=np.array(ON_TABLE))] if claimed else []
    none = dict.fromkeys(AUDIT_KEYS, 0)
    assert counted(("red_bin",), OneBody(UNKNOWN_LABEL, place), records=items) == {**none, **end}
