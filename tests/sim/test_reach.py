"""Places of a cell file that the tool cannot go to are found before anything moves."""

from __future__ import annotations

from typing import Any

import pytest

from executive.cell_config import CellConfig
from executive.sim.poses import out_of_reach


def moved(config: CellConfig, bin: str, *position: float) -> CellConfig:
    """Return the cell with a bin elsewhere [m]."""
    section = config.bins[bin].model_copy(update={"position": position})
    return config.model_copy(update={"bins": {**config.bins, bin: section}})


def posed(config: CellConfig, **poses: Any) -> CellConfig:
    """Return the cell with more named poses [degree]."""
    arm = config.arm.model_copy(update={"poses_deg": {**config.arm.poses_deg, **poses}})
    return config.model_copy(update={"arm": arm})


def test_nothing_is_out_of_reach_in_the_shipped_cells(overhead: CellConfig, wrist: CellConfig) -> None:
    assert [*out_of_reach(overhead), *out_of_reach(wrist)] == []


@pytest.mark.parametrize(
    ("position", "why"),
    [
        ((0.6, -0.6, 0.0), "farther than the arm is long (0.82 m)"),
        ((0.24, -0.25, 0.0), "nearer than joint 4 can fold (0.41 m)"),
    ],
)
def test_a_bin_with_one_slot_out_of_reach_is_named_with_the_distance(
    overhead: CellConfig, position: tuple[float, float, float], why: str
) -> None:
    ((keys, sentence),) = out_of_reach(moved(overhead, "red_bin", *position))
    assert keys == ("bins", "red_bin", "position")
    assert sentence.startswith('the bin "red_bin" is out of reach: the tool cannot reach (')
    assert sentence.endswith(why)


def test_the_safe_place_must_be_within_reach(overhead: CellConfig) -> None:
    config = overhead.model_copy(update={"safe_place": (0.9, 0.0, 0.0)})
    ((keys, sentence),) = out_of_reach(config)
    assert keys == ("safe_place",)
    assert sentence.startswith("the safe place is out of reach: the tool cannot reach (0.900, 0.000, ")


def test_a_pose_beyond_a_joint_limit_names_the_joint(overhead: CellConfig) -> None:
    config = posed(overhead, turned=(0, 33, 0, -88, 0, 59, 180))
    assert list(out_of_reach(config)) == [
        (("arm", "poses_deg", "turned"), 'joint 7 of the pose "turned" is at 180 degrees; its limit is 175')
    ]
