"""Symmetries of the square, applied to images and boxes without resampling of pixels."""

from __future__ import annotations

import torch

SYMMETRY_COUNT = 8
"""Number of symmetries. Symmetry 2 k rotates by k quarter turns anticlockwise; symmetry 2 k + 1 first mirrors
left to right, then rotates by k quarter turns."""


def transform_image(image: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `image` `(..., N, N)`, transformed by the symmetry with the number `symmetry`, 0 to 7."""
    mirrored = image.flip(-1) if symmetry % 2 else image
    return mirrored.rot90(symmetry // 2, (-2, -1))


def transform_boxes(boxes: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `boxes` `(N, 4)` (centre x and y, width, height; 0 to 1), transformed by a symmetry, 0 to 7."""
    x, y, width, height = boxes.unbind(-1)
    if symmetry % 2:
        x = 1 - x
    for _ in range(symmetry // 2):
        # A quarter turn anticlockwise moves the right edge of the image to the top.
        x, y, width, height = y, 1 - x, height, width
    return torch.stack((x, y, width, height), dim=-1)
