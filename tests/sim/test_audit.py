"""The audit where it could count wrongly."""

from __future__ import annotations

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


def test_what_hangs_in_the_tool_over_its_bin_is_left_and_not_placed() -> None:
    bins = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}
    initial = {7: np.array([0.5, 0.0, 0.025])}
    ended = {
        held: audit(OneBody(), initial, [], bins, {"cube": "red_bin"}, 0.025, held=held)  # type: ignore[arg-type]
        for held in (None, 7)
    }
    assert (ended[None]["right"], ended[None]["left"]) == (1, 0)
    assert (ended[7]["right"], ended[7]["left"]) == (0, 1)
