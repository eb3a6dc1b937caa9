"""Camera of the simulated cell: rendered images, depth and noise."""

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
"""Light of every simulated cell: a white lamp, slightly in front and to the left, without shadows."""
DEPTH_STREAM = 1
"""Last number of the seed of the depth noise, which separates it from the seed of the image noise."""


@dataclass(frozen=True, eq=False)
class Render:
    """A rendered part of a camera image, without noise.

    Attributes:
        image: `(h, w, 3)` uint8, RGB.
        bodies: `(h, w)` visible body at each pixel, -1 for none.
        buffer: `(h, w)` depth buffer of OpenGL.
    """

    image: Image
    bodies: NDArray[np.int32]
    buffer: NDArray[np.float32]

    @property
    def depth(self) -> Array:
        """Distances along the optical axis `(h, w)` [m], inf at pixels without a body."""
        with np.errstate(divide="ignore"):
            distances = FAR * NEAR / (FAR - (FAR - NEAR) * self.buffer.astype(np.float64))
        return np.where(self.buffer < 1.0, distances, np.inf)


def camera_pose(world: World, config: CameraConfig) -> Pose:
    """Return the current pose `X_WC` of a camera."""
    _, X_MC = compute_calibration(config)
    return X_MC if config.mount == "fixed" else world.flange_pose() @ X_MC


def render(world: World, matrix: Array, X_WC: Pose, part: tuple[int, int, int, int], light: Light) -> Render:
    """Render `part` (left, top, right, bottom [pixel]) of a camera image at the resolution of the camera."""
    left, top, right, bottom = part
    width, height = right - left, bottom - top
    # TinyRenderer samples a pixel at its lower left corner; a shift by half a pixel samples the centre.
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
    """Return the image with a random brightness factor and read noise at each pixel."""
    gain = rng.normal(1.0, noise.gain)
    read = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(noise.read)
    return np.asarray(np.clip(image * np.float32(gain) + read + 0.5, 0, 255).astype(np.uint8))


def add_depth_noise(true: Array, config: DepthConfig, rng: np.random.Generator) -> Array:
    """Return measurements of distances `(H, W)` [m], NaN at pixels without a measurement.

    The noise of neighbours is correlated, because stereo matching compares windows. Beside an edge a surface
    is often visible to only one of the two cameras of the sensor, so measurements are often missing.
    """
    noise = rng.standard_normal(true.shape)
    if config.grain:
        # The blur reduces the standard deviation; the division restores it to 1.
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), config.grain), dtype=np.float64)
        noise /= noise.std()
    seen = np.where(np.isfinite(true), true, np.nan)
    measured = seen + noise * (config.floor + config.growth * seen**2)
    if config.step:
        measured = np.round(measured / config.step) * config.step
    lost = rng.random(true.shape) < np.where(_find_edges(true, config), config.edge_dropout, config.dropout)
    return np.where(lost, np.nan, measured)


def _find_edges(true: Array, config: DepthConfig) -> Mask:
    """Return the mask `(H, W)` of pixels near a depth discontinuity."""
    finite = np.where(np.isfinite(true), true, FAR).astype(np.float32)
    kernel = np.ones((3, 3), np.uint8)
    edges = (cv2.dilate(finite, kernel) - cv2.erode(finite, kernel) > config.edge).astype(np.uint8)
    width = 2 * config.edge_width + 1
    return cv2.dilate(edges, np.ones((width, width), np.uint8)).astype(bool)


class SimCamera(MountedCamera):
    """A camera of the simulated world; satisfies `executive.cell.protocols.Camera`.

    The noise of frame n depends only on the seed and n; a depth sensor does not change the noise of images.
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
            world: The observed world.
            name: Name of the camera in the cell file.
            config: Section of the camera in the cell file.
            clock: Clock for the time of the frames.
            seed: Seed of the noise.
            shadow: Occlusion by the arm; by default the arm hides nothing, and the table is always visible.
            epoch: Returns the ledger's count of changes of the table.
            light: Light of the scene.
            true: True pose, lens and noise of the images if they differ from `config`. Frames carry the
                matrix and the pose of `config`.
            bins: Bins whose positions in a frame show a displacement of the camera.
        """
        super().__init__(name, config, world.flange_pose, clock, epoch)
        self._true = true or config
        self._world = world
        self._seed = seed
        self._shadow = shadow
        self._light = light
        self._bins = bins

    def sees_table(self) -> bool:
        """Return True if the whole workspace is visible now, not hidden by the arm."""
        return self._shadow is None or self._shadow.sees_table(self.matrix, self._pose(), self._size)

    def describe_displacement(self, frame: Frame) -> str:
        """Return a text with the displacement of the camera from its declared pose in a frame; "" if none."""
        return describe_displacement(frame, self._bins)

    @property
    def _size(self) -> tuple[int, int]:
        return self.config.width, self.config.height

    def _true_view(self) -> tuple[Array, Pose]:
        """Return the true camera matrix and the true pose `X_WC`."""
        return compute_calibration(self._true)[0], camera_pose(self._world, self._true)

    def _capture_images(self) -> tuple[Image, Array | None]:
        """Return the image and, with a depth sensor, the depth of the current frame."""
        clean = render(self._world, *self._true_view(), (0, 0, *self._size), self._light)
        image = add_noise(clean.image, self._true.noise, np.random.default_rng([self._seed, self._frames]))
        if self.config.depth is None:
            return image, None
        rng = np.random.default_rng([self._seed, self._frames, DEPTH_STREAM])
        return image, add_depth_noise(clean.depth, self.config.depth, rng)

    def _compute_visibility_mask(self, X_WC: Pose) -> Mask:
        if self._shadow is None:
            return np.ones(self._size[::-1], np.bool_)
        return self._shadow.visible(self.matrix, X_WC, self._size)
