"""Frames of one colour from a camera above the workspace."""

from __future__ import annotations

import numpy as np

from executive.cell.frame import Frame
from tests.camera_poses import looking_down


def frame_of(colour: tuple[int, int, int]) -> Frame:
    """Return a frame of one colour from 1.2 m above the workspace."""
    image = np.full((480, 640, 3), colour, np.uint8)
    matrix = np.array([[461.0, 0, 320.0], [0, 461.0, 240.0], [0, 0, 1.0]])
    visible = np.ones((480, 640), bool)
    return Frame(1, "camera", image, None, matrix, looking_down((0.5, 0.0, 1.2)), 0.0, visible, 0)
