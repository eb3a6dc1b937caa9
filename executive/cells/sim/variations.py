"""Random light, table, camera and noise of a labelled scene (domain randomization).

The ranges are larger than the variation in scenes of missions.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Sequence

import cv2
import numpy as np

from executive.cell.config import CameraConfig, Colour, NoiseConfig
from executive.cell.config.section import Range
from executive.cells.sim.renderer import Light
from executive.cells.sim.table_top import PLAIN_TEXTURE, TEXTURES, WOOD_TEXTURE
from executive.geometry import Array, Pose, rotate_about_z
from executive.perception.camera_model import intersect_plane

MAX_FOV_CHANGE = 0.27
"""Maximum relative change of the field of view."""
MAX_DISTANCE_CHANGE = 0.27
"""Maximum relative change of the distance of a fixed camera from the centre of its view on the table."""
MAX_SHIFT = 0.06
"""Maximum shift of a fixed camera along x and y [m]."""
MAX_TILT = math.radians(16)
"""Maximum tilt of a fixed camera about the centre of its view on the table [rad]."""
WOOD_COLOUR = (0.87, 0.78, 0.65)
"""Mean colour of the wood texture of the table: red, green and blue, each 0 to 1."""


def draw_light(rng: np.random.Generator) -> Light:
    """Return the light of the cell (probability 0.2), or a light with normal, low or high brightness."""
    shadow = bool(rng.random() < 0.35)
    if rng.random() < 0.2:
        return Light(shadow=shadow)
    azimuth, elevation = rng.uniform(0, math.tau), rng.uniform(math.radians(18), math.pi / 2)
    x, y = math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth)
    red, green, blue = rng.uniform(0.72, 1.0, 3)
    random_number = rng.random()
    brightness = 1.0 if random_number < 0.5 else 1.5
    if 0.5 <= random_number < 0.8:
        brightness = math.exp(rng.uniform(math.log(0.12), 0.0))
    return Light(
        direction=(x, y, math.sin(elevation)),
        colour=(red, green, blue),
        ambient=brightness * rng.uniform(0.40, 0.70),
        diffuse=brightness * rng.uniform(0.20, 0.60),
        specular=rng.uniform(0.0, 0.8) if random_number >= 0.8 else brightness * rng.uniform(0.0, 0.30),
        shadow=shadow,
    )


def draw_table_appearance(rng: np.random.Generator) -> tuple[Colour, str]:
    """Return colour and texture of the table: unchanged in 30 % of the scenes, slightly tinted in 20 %.

    In the other scenes the table has a random colour, and a wood texture, no texture or a random texture.
    """
    random_number = rng.random()
    if random_number < 0.3:
        return (1.0, 1.0, 1.0), WOOD_TEXTURE
    if random_number < 0.5:
        red, green, blue = rng.uniform(0.75, 1.0) * rng.uniform(0.88, 1.0, 3)
        return (red, green, blue), WOOD_TEXTURE
    texture = WOOD_TEXTURE if random_number < 0.6 else PLAIN_TEXTURE
    if random_number >= 0.75:
        texture = str(rng.choice(TEXTURES))
    return draw_hsv_colour(rng, (0.0, 0.8), (0.10, 1.0)), texture


def draw_object_colour(palette: Sequence[Colour], table_colour: Colour, rng: np.random.Generator) -> Colour:
    """Return a random object colour: of the class, of any hue, grey, nearly black, or similar to the table.

    Args:
        palette: Colours of the class of the object.
        table_colour: Mean colour of the table.
        rng: Random number generator.
    """
    random_number = rng.random()
    if random_number < 0.35:
        return palette[int(rng.integers(len(palette)))]
    if random_number < 0.65:
        return draw_hsv_colour(rng, (0.3, 1.0), (0.25, 1.0))
    if random_number < 0.78:
        grey = rng.uniform(0.05, 1.0)
        return grey, grey, grey
    if random_number < 0.93:
        return draw_hsv_colour(rng, (0.0, 0.6), (0.02, 0.16))
    red, green, blue = np.clip(table_colour + rng.normal(0, 0.12, 3), 0.02, 1.0)
    return float(red), float(green), float(blue)


def draw_hsv_colour(rng: np.random.Generator, saturations: Range, values: Range) -> Colour:
    """Return a colour with random hue, and with saturation and value in the given ranges, each 0 to 1."""
    return colorsys.hsv_to_rgb(rng.random(), rng.uniform(*saturations), rng.uniform(*values))


def draw_camera(
    camera: CameraConfig, matrix: Array, X_WC: Pose, rng: np.random.Generator
) -> tuple[Array, Pose]:
    """Return camera matrix and pose of a camera: as declared in 40 % of the scenes, otherwise random.

    The pose of a camera on the wrist is not changed, because the pose of the arm already varies.

    Args:
        camera: Section of the camera in the cell file.
        matrix: Declared camera matrix `(3, 3)` [pixel].
        X_WC: Declared pose of the camera.
        rng: Random number generator.
    """
    if rng.random() < 0.4:
        return matrix, X_WC
    centre = np.array([camera.width - 1, camera.height - 1]) / 2
    half_fov = math.atan(camera.height / 2 / matrix[1, 1])
    focal_factor = math.tan(half_fov) / math.tan(half_fov * (1 + rng.uniform(-1, 1) * MAX_FOV_CHANGE))
    matrix = np.diag([focal_factor, focal_factor, 1.0]) @ matrix
    matrix[:2, 2] = centre
    if camera.mount == "wrist":
        return matrix, X_WC
    target = intersect_plane(matrix, X_WC, (centre[0], centre[1]), 0.0)
    angle, tilt = rng.uniform(0, math.tau), MAX_TILT * float(rng.choice([0.0, 0.1, 0.3, 1.0])) * rng.random()
    rotation, _ = cv2.Rodrigues(tilt * np.array([math.cos(angle), math.sin(angle), 0.0]))
    rotation = np.asarray(rotation) @ rotate_about_z(rng.normal(0, math.radians(3)))
    offset = (X_WC.position - target) * (1 + rng.uniform(-1, 1) * MAX_DISTANCE_CHANGE)
    shift = np.array([*rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2), 0.0])
    return matrix, Pose(rotation @ X_WC.rotation, target + rotation @ offset + shift)


def draw_noise(noise: NoiseConfig, rng: np.random.Generator) -> NoiseConfig:
    """Return the noise of a camera: as declared in 60 % of the scenes, otherwise random.

    Random gain noise exceeds the declared noise; random read noise is 0.37 to 9 times the declared noise.
    """
    if rng.random() < 0.6:
        return noise
    gain, read = noise.gain + rng.exponential(0.06), noise.read * math.exp(rng.uniform(-1, 2.2))
    return NoiseConfig(gain=gain, read=read)
