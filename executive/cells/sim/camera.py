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
from executive.cells.sim.arm_occlusion import ArmOcclusion
from executive.cells.sim.world import World
from executive.geometry import Array, Pose
from executive.perception.camera_check import describe_displacement
from executive.perception.camera_model import (
    FAR_PLANE,
    NEAR_PLANE,
    compute_calibration,
    compute_projection_matrix,
    compute_view_matrix,
)
from executive.perception.mounted_camera import MountedCamera

Image = NDArray[np.uint8]
"""Colour image `(H, W, 3)`, RGB."""
Mask = NDArray[np.bool_]
"""Mask `(H, W)` of pixels."""
Region = tuple[int, int, int, int]
"""Left, top, right and bottom of a region of an image [pixel]."""
ReflectionCoefficient = Annotated[float, Field(ge=0, le=3)]
"""Coefficient of the Phong model, which multiplies the light of one kind of reflection."""


class Light(Section):
    """The directional light and the ambient light; the defaults apply to every simulated cell."""

    direction: tuple[float, float, Annotated[float, Field(gt=0)]] = (0.3, 0.2, 1.0)
    """Direction x, y, z in the world from the table to the light; z is above 0, the length is ignored."""
    colour: Colour = (1.0, 1.0, 1.0)
    """Colour of the directional light: r, g, b, each 0 to 1."""
    ambient: ReflectionCoefficient = 0.6
    """Ambient coefficient of the Phong model, 0 to 3."""
    diffuse: ReflectionCoefficient = 0.35
    """Diffuse coefficient of the Phong model, 0 to 3."""
    specular: ReflectionCoefficient = 0.05
    """Specular coefficient of the Phong model, 0 to 3."""
    shadow: bool = False
    """True if objects cast shadows."""
    brightness: float = Field(1.0, ge=0, le=5)
    """Factor on `ambient`, `diffuse` and `specular`."""


CELL_LIGHT = Light()
"""Default light of simulated cells: white, from above, slightly from the front left, without shadows."""
DEPTH_SEED = 1
"""Last number of the seed of the depth noise; the other numbers are the seed of the image noise."""


@dataclass(frozen=True, eq=False)
class RenderedImage:
    """A rendered region of a camera image, without noise.

    Attributes:
        image: Colour image of the region `(H, W, 3)` uint8, RGB.
        bodies: Segmentation `(H, W)`: number of the visible body at each pixel, -1 for none.
        depth_buffer: Depth buffer of OpenGL `(H, W)`, 0 to 1.
        matrix: Camera matrix of the whole camera image `(3, 3)` [pixel].
        X_WC: Pose of the camera in the world.
        region: The rendered region of the camera image.
    """

    image: Image
    bodies: NDArray[np.int32]
    depth_buffer: NDArray[np.float32]
    matrix: Array
    X_WC: Pose
    region: Region

    @property
    def depth(self) -> Array:
        """Distances along the optical axis `(H, W)` [m], inf at pixels without a body."""
        # The formula inverts the perspective projection of OpenGL.
        depth_buffer = self.depth_buffer.astype(np.float64)
        with np.errstate(divide="ignore"):
            distances = FAR_PLANE * NEAR_PLANE / (FAR_PLANE - (FAR_PLANE - NEAR_PLANE) * depth_buffer)
        return np.where(self.depth_buffer < 1.0, distances, np.inf)


def get_camera_pose(world: World, config: CameraConfig) -> Pose:
    """Return the current pose `X_WC` of a camera; frame M is the mount, i.e. the world or the flange."""
    _, X_MC = compute_calibration(config)
    return X_MC if config.mount == "fixed" else world.get_flange_pose() @ X_MC


def render(world: World, matrix: Array, X_WC: Pose, region: Region, light: Light) -> RenderedImage:
    """Render a region of a camera image at full resolution."""
    left, top, right, bottom = region
    width, height = right - left, bottom - top
    # TinyRenderer samples the lower left corner of a pixel; a shift by half a pixel samples the centre.
    shifted_region = (left + 0.5, top - 0.5, right + 0.5, bottom - 0.5)
    _, _, rgba, depth_buffer, segmentation = world.client.getCameraImage(
        width,
        height,
        compute_view_matrix(X_WC),
        compute_projection_matrix(matrix, shifted_region),
        lightDirection=light.direction,
        lightColor=light.colour,
        lightDistance=3.0,
        shadow=int(light.shadow),
        lightAmbientCoeff=light.brightness * light.ambient,
        lightDiffuseCoeff=light.brightness * light.diffuse,
        lightSpecularCoeff=light.brightness * light.specular,
        renderer=pybullet.ER_TINY_RENDERER,
    )
    image = np.ascontiguousarray(np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3])
    bodies = np.asarray(segmentation, dtype=np.int32).reshape(height, width)
    depth_buffer = np.asarray(depth_buffer, dtype=np.float32).reshape(height, width)
    return RenderedImage(image, bodies, depth_buffer, matrix, X_WC, region)


def add_noise(image: Image, noise: NoiseConfig, rng: np.random.Generator) -> Image:
    """Return the image with a random brightness factor for all pixels and read noise at each pixel."""
    gain = rng.normal(1.0, noise.gain)
    read_noise = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(noise.read)
    return np.asarray(np.clip(image * np.float32(gain) + read_noise + 0.5, 0, 255).astype(np.uint8))


def add_depth_noise(depth: Array, config: DepthConfig, rng: np.random.Generator) -> Array:
    """Return noisy measurements of a depth image `(H, W)` [m], NaN at pixels without a measurement.

    The standard deviation is `floor + growth * depth²`, as in stereo vision. The noise of neighbouring pixels
    is correlated, because stereo matching compares windows. Beside an edge, measurements are often missing,
    because only one of the two cameras of the sensor sees the surface.
    """
    noise = rng.standard_normal(depth.shape)
    if config.grain:
        # The blur reduces the standard deviation, and the division restores the value 1.
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), config.grain), dtype=np.float64)
        noise /= noise.std()
    true_depth = np.where(np.isfinite(depth), depth, np.nan)
    measured_depth = true_depth + noise * (config.floor + config.growth * true_depth**2)
    if config.step:
        measured_depth = np.round(measured_depth / config.step) * config.step
    dropout_probability = np.where(_compute_edge_mask(depth, config), config.edge_dropout, config.dropout)
    return np.where(rng.random(depth.shape) < dropout_probability, np.nan, measured_depth)


def _compute_edge_mask(depth: Array, config: DepthConfig) -> Mask:
    """Return the mask `(H, W)` of the pixels near a discontinuity of the depth."""
    distances = np.where(np.isfinite(depth), depth, FAR_PLANE).astype(np.float32)
    kernel = np.ones((3, 3), np.uint8)
    edge_mask = (cv2.dilate(distances, kernel) - cv2.erode(distances, kernel) > config.edge).astype(np.uint8)
    width = 2 * config.edge_width + 1
    return cv2.dilate(edge_mask, np.ones((width, width), np.uint8)).astype(bool)


class SimCamera(MountedCamera):
    """A camera of the simulated world; implements `executive.cell.protocols.Camera`.

    The cell file of the world contains the true extrinsics, intrinsics and noise of the camera. The frames
    contain the matrix and the pose of `config`. The noise of a frame depends only on the seed and on the
    number of the frame. A depth sensor does not change the image noise.

    Args:
        world: The observed world.
        name: Name of the camera in the cell file.
        config: Section of the camera in the cell file.
        clock: Clock for the time stamps of the frames.
        seed: Seed of the noise.
        occlusion: Occlusion by the arm.
        get_change_count: Returns the number of changes of the objects on the table so far.
        light: Light of the scene.
        bins: Bins that serve as landmarks for the detection of a displaced camera.
    """

    def __init__(
        self,
        world: World,
        name: str,
        config: CameraConfig,
        clock: Clock,
        seed: int,
        *,
        occlusion: ArmOcclusion,
        get_change_count: Callable[[], int] = lambda: 0,
        light: Light = CELL_LIGHT,
        bins: Sequence[Bin] = (),
    ) -> None:
        super().__init__(name, config, world.get_flange_pose, clock, get_change_count)
        self._true_config = world.config.cameras[name]
        self._world = world
        self._seed = seed
        self._occlusion = occlusion
        self._light = light
        self._bins = bins

    def sees_table(self) -> bool:
        """Return True if the whole workspace is in the image now and not occluded by the arm."""
        return self._occlusion.is_table_visible(self.matrix, self._compute_pose(), self._size)

    def describe_displacement(self, frame: Frame) -> str:
        """Return a message if a frame shows a displacement of the camera from the declared pose, else ""."""
        return describe_displacement(frame, self._bins)

    @property
    def _size(self) -> tuple[int, int]:
        return self.config.width, self.config.height

    def _get_true_view(self) -> tuple[Array, Pose]:
        """Return the true camera matrix and the true pose `X_WC`."""
        return compute_calibration(self._true_config)[0], get_camera_pose(self._world, self._true_config)

    def _capture_images(self) -> tuple[Image, Array | None]:
        """Return colour and depth image of the current frame; without a depth sensor, the latter is None."""
        rendered = render(self._world, *self._get_true_view(), (0, 0, *self._size), self._light)
        rng = np.random.default_rng([self._seed, self._frame_count])
        image = add_noise(rendered.image, self._true_config.noise, rng)
        if self.config.depth is None:
            return image, None
        rng = np.random.default_rng([self._seed, self._frame_count, DEPTH_SEED])
        return image, add_depth_noise(rendered.depth, self.config.depth, rng)

    def _compute_visibility_mask(self, X_WC: Pose) -> Mask:
        return self._occlusion.compute_visibility_mask(self.matrix, X_WC, self._size)
