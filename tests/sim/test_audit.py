"""The audit where it could count wrongly."""

from __future__ import annotations

from typing import Any

import numpy as np

from executive.geometry import Pose
from executive.messages import Bin
from executive.sim.audit import audit


class OneBody:
    """A world with one cube over the bin."""

    def __init__(self) -> None:
        self.bodies = {7: "cube"}

    def object_pose(self, body: int) -> Pose:
        return Pose.of((0.2, -0.44, 0.12))


def counted(bins_of_cube: tuple[str, ...], held: int | None = None, **more: Any) -> dict[str, int]:
    bins = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}
    stood = {7: [np.array([0.5, 0.0, 0.025])]}
    return audit(OneBody(), stood, [], bins, {"cube": bins_of_cube}, 0.025, held=held, **more)  # type: ignore[arg-type]


def test_what_hangs_in_the_tool_over_its_bin_is_left_and_not_placed() -> None:
    ended = {held: counted(("red_bin",), held=held) for held in (None, 7)}
    assert (ended[None]["right"], ended[None]["left"]) == (1, 0)
    assert (ended[7]["right"], ended[7]["left"]) == (0, 1)


def test_any_bin_of_its_class_is_right_and_no_other() -> None:
    assert counted(("blue_bin", "red_bin"))["right"] == 1
    assert counted(("blue_bin", "grey_bin"))["wrong_bin"] == 1


def test_what_fell_into_a_wrong_bin_was_put_there_by_nobody() -> None:
    ended = counted(("blue_bin",), fallen={7})
    assert (ended["wrong_bin"], ended["elsewhere"]) == (0, 1)
    assert counted(("red_bin",), fallen={7})["right"] == 1
