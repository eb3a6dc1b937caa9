"""Colour and texture of the simulated table."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.cell.config import Colour

WOOD_TEXTURE, PLAIN_TEXTURE = "wood", "plain"
"""Names of the texture in the URDF of the table, and of a white surface."""
PATTERN_COUNT = 24
"""Number of generated textures, whose names are `pattern 0` to `pattern 23`."""
TEXTURES = (WOOD_TEXTURE, PLAIN_TEXTURE, *(f"pattern {number}" for number in range(PATTERN_COUNT)))
"""Names of all textures."""
TEXTURE_SIZE = 256
"""Side of a generated texture [pixel]."""


class TableTop:
    """The surface of the simulated table; `paint` changes only its appearance in camera images.

    Args:
        client: The connection to the physics server.
        table: Body of the table.
    """

    def __init__(self, client: BulletClient, table: int) -> None:
        self._client = client
        self._table = table
        shapes = client.getVisualShapeData(table, pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS)
        # A world without visual shapes needs no textures.
        self._textures = {PLAIN_TEXTURE: -1, WOOD_TEXTURE: shapes[0][8] if shapes else -1}

    def paint(self, colour: Colour, texture: str = WOOD_TEXTURE) -> None:
        """Give the table a texture of `TEXTURES`, with RGB values multiplied by `colour`."""
        if texture not in self._textures:
            seed = TEXTURES.index(texture)
            # PyBullet caches textures by path, so that each texture needs its own path.
            with tempfile.TemporaryDirectory() as folder:
                path = str(Path(folder) / f"{seed}.png")
                cv2.imwrite(path, generate_pattern(seed))
                self._textures[texture] = int(self._client.loadTexture(path))
        texture_id = self._textures[texture]
        self._client.changeVisualShape(self._table, -1, textureUniqueId=texture_id, rgbaColor=[*colour, 1])


def generate_pattern(seed: int) -> NDArray[np.uint8]:
    """Return a bright random texture of `TEXTURE_SIZE`, RGB: clouds, stripes, tiles or speckles."""
    rng = np.random.default_rng(seed)
    contrast = rng.uniform(15, 90)
    count = int(rng.choice([4, 8, 16, 32]))
    pattern_kind = seed % 4  # clouds, stripes, tiles or speckles
    size = (TEXTURE_SIZE, TEXTURE_SIZE)
    shape = ((count, count, 3), (1, count * 2, 3), (count, count, 1), (*size, 1))[pattern_kind]
    interpolation = cv2.INTER_CUBIC if pattern_kind in (0, 3) else cv2.INTER_NEAREST
    values = (255 - rng.uniform(0, contrast, shape) * np.ones(3)).astype(np.float32)
    return np.asarray(cv2.resize(values, size, interpolation=interpolation).clip(0, 255), np.uint8)
