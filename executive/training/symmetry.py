"""The eight symmetries of a square, applied to an image and its boxes without resampling a pixel."""

from __future__ import annotations

import torch

ELEMENTS = 8
"""Number of symmetries: odd ones mirror left to right, then 2 k and 2 k + 1 make k quarter turns."""


def transform_image(image: torch.Tensor, element: int) -> torch.Tensor:
    """Return `image` `(..., N, N)` transformed by the symmetry number `element`."""
    mirrored = image.flip(-1) if element % 2 else image
    return mirrored.rot90(element // 2, (-2, -1))


def transform_boxes(boxes: torch.Tensor, element: int) -> torch.Tensor:
    """Return `boxes` `(N, 4)` (centre x, y, width, height; each 0 to 1) transformed by the same symmetry."""
    x, y, width, height = boxes.unbind(-1)
    if element % 2:
        x = 1 - x
    for _ in range(element // 2):
        # A quarter turn anticlockwise on the screen moves the right edge to the top.
        x, y, width, height = y, 1 - x, height, width
    return torch.stack((x, y, width, height), dim=-1)
