"""Rendered images of the simulated world, depth, noise, and the camera that a simulated cell offers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.bins import Bin
from executive.cell.config import CameraConfig, Colour, DepthConfig, NoiseConfig, Section
from executive.cell.frame import Frame
from executive.cell.protocols import Clock
from executive.cells.sim.view import ArmShadow
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.perception.camera_check import describe_displacement
from executive.perception.camera_model import (
    FAR,
    NEAR,
    compute_calibration,
    compute_projection_matrix,
    compute_view_matrix,
)
from executive.perception.mounted_camera import MountedCamera

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]


Reflection = Annotated[float, Field(ge=0, le=3)]


class Light(Section):
    """A distant lamp and the ambient light; the defaults apply to every simulated cell."""

    direction: tuple[float, float, Annotated[float, Field(gt=0)]] = (0.3, 0.2, 1.0)
    """Direction x, y, z in the world from the table to the lamp; z is above 0, the length is ignored."""
    colour: Colour = (1.0, 1.0, 1.0)
    """Colour of the lamp's light: r, g, b, each 0 to 1."""
    ambient: Reflection = 0.6
    """Ambient coefficient of the Phong model, 0 to 3."""
    diffuse: Reflection = 0.35
    """Diffuse coefficient of the Phong model, 0 to 3."""
    specular: Reflection = 0.05
    """Specular coefficient of the Phong model, 0 to 3."""
    shadow: bool = False
    """True if objects cast shadows."""


CELL_LIGHT = Light()
"""The lamp of every simulated cell: white, a little in front and to the left, no shadows."""
DEPTH_STREAM = 1
"""Sets the random numbers of a frame's depth apart from those of its image; 0 would not."""


@dataclass(frozen=True, eq=False)
class Render:
    """A part of a camera's image as the renderer made it, free of noise.

    Attributes:
        image: `(h, w, 3)` uint8, RGB.
        bodies: `(h, w)` body seen at each pixel, -1 where there is none.
        buffer: `(h, w)` OpenGL's depth buffer.
    """

    image: Image
    bodies: NDArray[np.int32]
    buffer: NDArray[np.float32]

    @property
    def depth(self) -> Array:
        """Distances along the optical axis `(h, w)` [m], inf where there is no body."""
        with np.errstate(divide="ignore"):
            distances = FAR * NEAR / (FAR - (FAR - NEAR) * self.buffer.astype(np.float64))
        return np.where(self.buffer < 1.0, distances, np.inf)


def camera_pose(world: World, config: CameraConfig) -> Pose:
    """Return `X_WC` of a camera where it is mounted now."""
    _, X_MC = compute_calibration(config)
    return X_MC if config.mount == "fixed" else world.flange_pose() @ X_MC


def render(world: World, matrix: Array, X_WC: Pose, part: tuple[int, int, int, int], light: Light) -> Render:
    """Draw `part` (left, top, right, bottom [pixel]) of a camera's image at the camera's own resolution."""
    left, top, right, bottom = part
    width, height = right - left, bottom - top
    # TinyRenderer samples a pixel at its lower left corner; half a pixel further is its centre.
    sampled = (left + 0.5, top - 0.5, right + 0.5, bottom - 0.5)
    _, _, rgba, buffer, segmentation = world.client.getCameraImage(
        width,
        height,
        compute_view_matrix(X_WC),
        compute_projection_matrix(matrix, sampled),
        lightDirection=light.direction,
        lightColor=light.colour,
        lightDistance=3.0,
        shadow=int(light.shadow),
        lightAmbientCoeff=light.ambient,
        lightDiffuseCoeff=light.diffuse,
        lightSpecularCoeff=light.specular,
        renderer=pybullet.ER_TINY_RENDERER,
    )
    image = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3]
    return Render(
        np.ascontiguousarray(image),
        np.asarray(segmentation, dtype=np.int32).reshape(height, width),
        np.asarray(buffer, dtype=np.float32).reshape(height, width),
    )


def add_noise(image: Image, noise: NoiseConfig, rng: np.random.Generator) -> Image:
    """Return the image with one brightness factor for the frame and read noise for every pixel."""
    gain = rng.normal(1.0, noise.gain)
    read = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(noise.read)
    return np.asarray(np.clip(image * np.float32(gain) + read + 0.5, 0, 255).astype(np.uint8))


def add_depth_noise(true: Array, config: DepthConfig, rng: np.random.Generator) -> Array:
    """Return what the sensor measures of distances `(H, W)` [m]: NaN where it measures nothing.

    Neighbours err alike, for stereo matches windows and not pixels. Beside an edge one of its two cameras
    sees what the other does not, so there it often has nothing to match.
    """
    noise = rng.standard_normal(true.shape)
    if config.grain:
        # Averaging weakens noise; it shall have the deviation that the figures say.
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), config.grain), dtype=np.float64)
        noise /= noise.std()
    seen = np.where(np.isfinite(true), true, np.nan)
    measured = seen + noise * (config.floor + config.growth * seen**2)
    if config.step:
        measured = np.round(measured / config.step) * config.step
    lost = rng.random(true.shape) < np.where(_edges(true, config), config.edge_dropout, config.dropout)
    return np.where(lost, np.nan, measured)


def _edges(true: Array, config: DepthConfig) -> Mask:
    """Return where `(H, W)` a jump of the distance is near."""
    finite = np.where(np.isfinite(true), true, FAR).astype(np.float32)
    around = np.ones((3, 3), np.uint8)
    jumps = (cv2.dilate(finite, around) - cv2.erode(finite, around) > config.edge).astype(np.uint8)
    width = 2 * config.edge_width + 1
    return cv2.dilate(jumps, np.ones((width, width), np.uint8)).astype(bool)


class SimCamera(MountedCamera):
    """A camera of the simulated world; satisfies `executive.cell.protocols.Camera`.

    The noise of frame n depends on the seed and n alone, and that of its image
    not on whether there is a depth sensor.
    """

    def __init__(
        self,
        world: World,
        name: str,
        config: CameraConfig,
        clock: Clock,
        seed: int,
        *,
        shadow: ArmShadow | None = None,
        epoch: Callable[[], int] = lambda: 0,
        light: Light = CELL_LIGHT,
        true: CameraConfig | None = None,
        bins: Sequence[Bin] = (),
    ) -> None:
        """Mount the camera.

        Args:
            world: What it looks at.
            name: Its name in the cell file.
            config: Its section of the cell file.
            clock: Stamps the frames.
            seed: Seed of its noise.
            shadow: Tells what the arm hides; by default it hides nothing, and the table is always seen.
            epoch: Tells the ledger's count of changes of the table.
            light: How the scene is lit.
            true: The camera as it really is, if it differs from `config`: pose, lens and noise of the images.
                Frames carry the matrix and the pose of `config`.
            bins: The bins whose places in a frame show whether the camera is where `config` says.
        """
        super().__init__(name, config, world.flange_pose, clock, epoch)
        self._true = true or config
        self._world = world
        self._seed = seed
        self._shadow = shadow
        self._light = light
        self._bins = bins

    def sees_table(self) -> bool:
        """Tell whether the whole workspace is in view now, the arm not in front of it."""
        return self._shadow is None or self._shadow.sees_table(self.matrix, self._pose(), self._size)

    def displacement(self, frame: Frame) -> str:
        """Return in words how far a frame shows the camera beside its declared pose; "" if it does not."""
        return describe_displacement(frame, self._bins)

    @property
    def _size(self) -> tuple[int, int]:
        return self.config.width, self.config.height

    def _true_view(self) -> tuple[Array, Pose]:
        """Return the camera matrix and the pose `X_WC` that the images really have."""
        return compute_calibration(self._true)[0], camera_pose(self._world, self._true)

    def _sense(self) -> tuple[Image, Array | None]:
        """Return the image and, with a depth sensor, the depth of the frame being taken."""
        clean = render(self._world, *self._true_view(), (0, 0, *self._size), self._light)
        image = add_noise(clean.image, self._true.noise, np.random.default_rng([self._seed, self._frames]))
        if self.config.depth is None:
            return image, None
        rng = np.random.default_rng([self._seed, self._frames, DEPTH_STREAM])
        return image, add_depth_noise(clean.depth, self.config.depth, rng)

    def _find_visible(self, X_WC: Pose) -> Mask:
        if self._shadow is None:
            return np.ones(self._size[::-1], np.bool_)
        return self._shadow.visible(self.matrix, X_WC, self._size)
