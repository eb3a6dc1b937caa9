"""Random light, table, camera and noise of a labelled scene.

The ranges are larger than those of the scenes of missions (domain randomization).
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Sequence

import cv2
import numpy as np

from executive.cell.config import CameraConfig, Colour, NoiseConfig
from executive.cells.sim.camera import CELL_LIGHT, Light
from executive.cells.sim.table_top import PLAIN, TEXTURES, WOOD
from executive.geometry import Array, Pose, rotate_about_z
from executive.perception.camera_model import intersect_plane

MAX_FOV_CHANGE = 0.27
"""Largest relative change of the field of view."""
MAX_HEIGHT_CHANGE = 0.27
"""Largest relative change of the height of a fixed camera over the table."""
MAX_SHIFT = 0.06
"""Largest shift of a fixed camera along x and y [m]."""
MAX_TILT = math.radians(16)
"""Largest tilt of a camera about the point of the table that it looks at [rad]."""
WOOD_COLOUR = (0.87, 0.78, 0.65)
"""Mean colour of the table without a tint."""


def random_light(rng: np.random.Generator) -> Light:
    """Return the cell's lamp in 20 % of the scenes, else one that is normal, dimmed or too bright."""
    shadow = bool(rng.random() < 0.35)
    if rng.random() < 0.2:
        return Light(shadow=shadow) if shadow else CELL_LIGHT
    azimuth, elevation = rng.uniform(0, math.tau), rng.uniform(math.radians(18), math.pi / 2)
    horizontal = math.cos(elevation)
    red, green, blue = rng.uniform(0.72, 1.0, 3)
    draw = rng.random()
    level = 1.0 if draw < 0.5 else math.exp(rng.uniform(math.log(0.12), 0.0)) if draw < 0.8 else 1.5
    return Light(
        direction=(horizontal * math.cos(azimuth), horizontal * math.sin(azimuth), math.sin(elevation)),
        colour=(red, green, blue),
        ambient=level * rng.uniform(0.40, 0.70),
        diffuse=level * rng.uniform(0.20, 0.60),
        specular=rng.uniform(0.0, 0.8) if draw >= 0.8 else level * rng.uniform(0.0, 0.30),
        shadow=shadow,
    )


def random_table(rng: np.random.Generator) -> tuple[Colour, str]:
    """Return colour and texture of the table: unchanged in 30 % of the scenes, slightly tinted in 20 %.

    In the others it has any colour, on wood, on a plain surface or on a random texture.
    """
    draw = rng.random()
    if draw < 0.3:
        return (1.0, 1.0, 1.0), WOOD
    if draw < 0.5:
        red, green, blue = rng.uniform(0.75, 1.0) * rng.uniform(0.88, 1.0, 3)
        return (red, green, blue), WOOD
    texture = WOOD if draw < 0.6 else PLAIN if draw < 0.75 else str(rng.choice(TEXTURES))
    return random_hsv_colour(rng, 0.0, 0.8, 0.10, 1.0), texture


def random_object_colour(palette: Sequence[Colour], table: Colour, rng: np.random.Generator) -> Colour:
    """Return a colour of an object: of its class, any hue, a grey, nearly black, or nearly the table's.

    Args:
        palette: Colours of its class.
        table: Mean colour of the table.
        rng: Random number generator.
    """
    draw = rng.random()
    if draw < 0.35:
        return palette[int(rng.integers(len(palette)))]
    if draw < 0.65:
        return random_hsv_colour(rng, 0.3, 1.0, 0.25, 1.0)
    if draw < 0.78:
        grey = rng.uniform(0.05, 1.0)
        return grey, grey, grey
    if draw < 0.93:
        return random_hsv_colour(rng, 0.0, 0.6, 0.02, 0.16)
    red, green, blue = np.clip(table + rng.normal(0, 0.12, 3), 0.02, 1.0)
    return float(red), float(green), float(blue)


def random_hsv_colour(
    rng: np.random.Generator, min_saturation: float, max_saturation: float, min_value: float, max_value: float
) -> Colour:
    """Return a colour of any hue, with saturation and value in the given ranges, all 0 to 1."""
    return colorsys.hsv_to_rgb(
        rng.random(), rng.uniform(min_saturation, max_saturation), rng.uniform(min_value, max_value)
    )


def random_camera(
    camera: CameraConfig, matrix: Array, X_WC: Pose, rng: np.random.Generator
) -> tuple[Array, Pose]:
    """Return camera matrix and pose: as declared in 40 % of the scenes, else random.

    The pose of a camera on the wrist is not changed: the pose of the arm already varies.

    Args:
        camera: Section of the cell file.
        matrix: Declared camera matrix `(3, 3)` [pixel].
        X_WC: Declared pose of the camera.
        rng: Random number generator.
    """
    if rng.random() < 0.4:
        return matrix, X_WC
    centre = np.array([camera.width - 1, camera.height - 1]) / 2
    half_field = math.atan(camera.height / 2 / matrix[1, 1])
    factor = math.tan(half_field) / math.tan(half_field * (1 + rng.uniform(-1, 1) * MAX_FOV_CHANGE))
    matrix = np.diag([factor, factor, 1.0]) @ matrix
    matrix[:2, 2] = centre
    if camera.mount == "wrist":
        return matrix, X_WC
    target = intersect_plane(matrix, X_WC, (centre[0], centre[1]), 0.0)
    axis, tilt = rng.uniform(0, math.tau), MAX_TILT * float(rng.choice([0.0, 0.1, 0.3, 1.0])) * rng.random()
    rotation, _ = cv2.Rodrigues(tilt * np.array([math.cos(axis), math.sin(axis), 0.0]))
    rotation = np.asarray(rotation) @ rotate_about_z(rng.normal(0, math.radians(3)))
    offset = (X_WC.position - target) * (1 + rng.uniform(-1, 1) * MAX_HEIGHT_CHANGE)
    shift = np.array([*rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2), 0.0])
    return matrix, Pose(rotation @ X_WC.rotation, target + rotation @ offset + shift)


def random_noise(noise: NoiseConfig, rng: np.random.Generator) -> NoiseConfig:
    """Return the noise of a camera: as declared in 60 % of the scenes.

    Else the noise of the gain is larger, and the read noise is 0.37 to 9 times as large.
    """
    if rng.random() < 0.6:
        return noise
    return NoiseConfig(
        gain=noise.gain + rng.exponential(0.06), read=noise.read * math.exp(rng.uniform(-1, 2.2))
    )
