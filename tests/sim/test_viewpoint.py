"""The viewpoint of films: all that matters is in the picture, as large as it can be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.mission.parse.cell_file import load_cell
from executive.sim.viewpoint import ARM_HEIGHT, overview
from executive.vision.camera_model import project

SIZE = (800, 720)
PART = (20.0, 60.0, 780.0, 640.0)


@pytest.mark.parametrize("name", ["overhead", "wrist", "fasteners"])
def test_arm_workspace_and_bins_fill_the_part_that_is_theirs(name: str, missions: Path) -> None:
    config = load_cell(missions / "cells" / f"{name}.yaml")
    view = overview(config, SIZE, PART)
    points = [(0, 0, 0), (0, 0, ARM_HEIGHT), *((x, y, 0) for x in config.table.x for y in config.table.y)]
    for bin in config.bins.values():
        (x, y, z), (length, width, height) = bin.position, bin.size
        points += [(x + i * length, y + j * width, z + height) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    seen = project(view.matrix, view.X_WC, np.array(points, dtype=float))
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert (low >= np.array(PART[:2]) - 1e-6).all()
    assert (high <= np.array(PART[2:]) + 1e-6).all()
    # As near as can be: in one direction it goes from edge to edge, in the other it is in the middle.
    spare = np.array([low - PART[:2], np.array(PART[2:]) - high])
    assert np.abs(spare).sum(axis=0).min() < 1e-6
    assert view.X_WC.position[2] > ARM_HEIGHT
    assert view.size == SIZE


def test_higher_is_further_up_in_the_picture(overhead: CellConfig) -> None:
    view = overview(overhead, SIZE, PART)
    foot, head = project(view.matrix, view.X_WC, np.array([[0, 0, 0.0], [0, 0, 0.5]]))
    assert head[1] < foot[1]
