"""The audit where it could count wrongly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from executive.geometry import Pose
from executive.messages import Bin
from executive.sim.audit import audit


class OneBody:
    """A world with one cube over the bin."""

    def __init__(self) -> None:
        self.bodies = {7: "cube"}

    def object_pose(self, body: int) -> Pose:
        return Pose.of((0.2, -0.44, 0.12))


def counted(bins_of_cube: tuple[str, ...], **more: Any) -> dict[str, int]:
    bins = {"red_bin": Bin("red_bin", np.array([0.2, -0.44, 0]), np.array([0.2, 0.2, 0.1]), np.zeros((1, 2)))}
    stood = {7: [np.array([0.5, 0.0, 0.025])]}
    return audit(OneBody(), stood, [], bins, {"cube": bins_of_cube}, 0.025, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("bins", "more", "end"),
    [
        (("red_bin",), {}, "right"),
        (("blue_bin", "red_bin"), {}, "right"),
        (("blue_bin", "grey_bin"), {}, "wrong_bin"),
        (("red_bin",), {"held": 7}, "left"),
        (("blue_bin",), {"fallen": {7}}, "elsewhere"),
        (("red_bin",), {"fallen": {7}}, "right"),
    ],
)
def test_a_body_in_a_bin_counts_by_its_class_and_by_who_put_it_there(
    bins: tuple[str, ...], more: dict[str, Any], end: str
) -> None:
    none = {"right": 0, "wrong_bin": 0, "left": 0, "elsewhere": 0, "unseen": 1}
    assert counted(bins, **more) == {**none, end: 1}
