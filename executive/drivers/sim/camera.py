"""Camera of the simulated cell: rendering of images and depth with noise, and occlusion by the arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.config import CellConfig
from executive.cell.device_config import CameraConfig, Colour, DepthConfig, NoiseConfig, Section
from executive.cell.devices import CameraImage
from executive.cell.protocols import Clock
from executive.drivers import world_log
from executive.drivers.sim.world import World
from executive.geometry import Array, Pose
from executive.perception.camera_model import (
    FAR_PLANE,
    compute_calibration,
    compute_depths,
    compute_projection_matrix,
    compute_view_matrix,
)
from executive.text.validate import KeyPath

Image = NDArray[np.uint8]
"""Colour image `(H, W, 3)`, RGB."""
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


_VisualShape = tuple[int, int, int, Sequence[float]]
"""A visual shape: body, link, index among the shapes of the link, and colour."""
CELL_LIGHT = Light()
"""Default light of simulated cells: white, from above, slightly from the front left, without shadows."""


@dataclass(frozen=True, eq=False)
class RenderedImage:
    """A rendered region of a camera image, without noise.

    Attributes:
        image: Colour image of the region `(H, W, 3)` uint8, RGB.
        segmentation: Number `(H, W)` of the visible body at each pixel, -1 for none.
        depth_buffer: Depth buffer of OpenGL `(H, W)`, 0 to 1.
        matrix: Camera matrix of the whole camera image `(3, 3)` [pixel].
        X_WC: Pose of the camera in the world.
        region: The rendered region of the camera image.
    """

    image: Image
    segmentation: NDArray[np.int32]
    depth_buffer: NDArray[np.float32]
    matrix: Array
    X_WC: Pose
    region: Region

    @property
    def depth(self) -> Array:
        """Distances along the optical axis `(H, W)` [m], inf at pixels without a body."""
        return np.where(self.depth_buffer < 1.0, compute_depths(self.depth_buffer), np.inf)


def render(world: World, matrix: Array, X_WC: Pose, region: Region, light: Light) -> RenderedImage:
    """Render a region of a camera image at full resolution."""
    left, top, right, bottom = region
    width = right - left
    height = bottom - top
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
    segmentation = np.asarray(segmentation, dtype=np.int32).reshape(height, width)
    depth_buffer = np.asarray(depth_buffer, dtype=np.float32).reshape(height, width)
    return RenderedImage(image, segmentation, depth_buffer, matrix, X_WC, region)


class FixedViewRenderer:
    """Renderer of a fixed camera, which renders the static bodies only once.

    Floor, table and bins take three quarters of the time of an image. Therefore, the first call of `render`
    stores an image of them. Each call combines this image with a new image of the arm and the objects: each
    pixel shows the nearer body, and of two bodies at the same distance the body that moves. The combined
    image is equal to an image of all bodies, because TinyRenderer computes each pixel from the nearest body
    alone if bodies cast no shadows.

    Args:
        world: The world, in which floor, table and bins do not change after the first call of `render`.
        region: The rendered region of the camera image.
        light: Light of the scene, in which objects cast no shadows.
    """

    def __init__(self, world: World, region: Region, light: Light) -> None:
        self._world = world
        self._region = region
        self._light = light
        static_bodies = (world.floor, world.table, *world.bin_bodies.values())
        self._static_shapes = [shape for body in static_bodies for shape in self._list_shapes(body)]
        # PyBullet reports wrong colours of the arm after the first call of `changeVisualShape`.
        self._arm_shapes = self._list_shapes(world.arm)
        self._background: RenderedImage | None = None
        self._background_view: tuple[tuple[float, ...], ...] = ()
        """Matrices of the view in the image of the static bodies."""

    def render(self, matrix: Array, X_WC: Pose) -> RenderedImage:
        """Render the current image; a camera that was moved gets a new image of the static bodies.

        `matrix` is the camera matrix `(3, 3)` [pixel], and `X_WC` the pose of the camera in the world.
        """
        view = compute_view_matrix(X_WC), compute_projection_matrix(matrix, self._region)
        background = self._background
        if background is None or view != self._background_view:
            object_shapes = [shape for body in self._world.labels for shape in self._list_shapes(body)]
            background = self._render_without(self._arm_shapes + object_shapes, matrix, X_WC)
            self._background = background
            self._background_view = view
        foreground = self._render_without(self._static_shapes, matrix, X_WC)
        is_in_front = foreground.depth_buffer <= background.depth_buffer
        return replace(
            foreground,
            image=np.where(is_in_front[..., None], foreground.image, background.image),
            segmentation=np.where(is_in_front, foreground.segmentation, background.segmentation),
            depth_buffer=np.where(is_in_front, foreground.depth_buffer, background.depth_buffer),
        )

    def _render_without(self, hidden_shapes: list[_VisualShape], matrix: Array, X_WC: Pose) -> RenderedImage:
        """Render an image in which some shapes are invisible."""
        try:
            for body, link, index, _ in hidden_shapes:
                # TinyRenderer omits a shape whose opacity, the last number of the colour, is 0.
                self._world.client.changeVisualShape(body, link, index, rgbaColor=(0, 0, 0, 0))
            return render(self._world, matrix, X_WC, self._region, self._light)
        finally:
            for body, link, index, colour in hidden_shapes:
                self._world.client.changeVisualShape(body, link, index, rgbaColor=colour)

    def _list_shapes(self, body: int) -> list[_VisualShape]:
        """Return all visual shapes of a body."""
        shapes: list[_VisualShape] = []
        for _, link, *_, colour in (data[:8] for data in self._world.client.getVisualShapeData(body)):
            index = sum(other_link == link for _, other_link, *_ in shapes)
            shapes.append((body, link, index, colour))
        return shapes


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
    distances = np.where(np.isfinite(depth), depth, FAR_PLANE).astype(np.float32)
    gradient = cv2.morphologyEx(distances, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    width = 2 * config.edge_width + 1
    edge_mask = cv2.dilate((gradient > config.edge).astype(np.uint8), np.ones((width, width), np.uint8))
    dropout_probability = np.where(edge_mask.astype(bool), config.edge_dropout, config.dropout)
    return np.where(rng.random(depth.shape) < dropout_probability, np.nan, measured_depth)


def find_missing_depth_sensors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each camera without a depth sensor if the cell localizes by depth."""
    for name, camera in config.cameras.items():
        if config.localization == "depth" and camera.depth is None:
            message = f'localization "depth" needs a camera with depth, and {name} has none; give it a '
            yield ("localization",), message + 'section "depth: {}", or use "plane"'


def get_camera_pose(world: World, config: CameraConfig) -> Pose:
    """Return the current pose `X_WC` of a camera; frame M is the mount, i.e. the world or the flange."""
    _, X_MC = compute_calibration(config)
    return X_MC if config.mount == "fixed" else world.get_flange_pose() @ X_MC


DEPTH_SEED = 1
"""Last number of the seed of the depth noise; the other numbers are the seed of the image noise."""


class SimCamera:
    """A camera of the simulated world; implements `executive.cell.devices.CameraDevice`.

    The cell file of the world contains the true extrinsics, intrinsics and noise of the camera. The noise of
    an image depends only on the seed and on the number of the image. A depth sensor does not change the image
    noise.

    Args:
        world: The observed world.
        config: The cell file.
        clock: Clock for the time stamps of the images.
        seed: Seed of the noise.
        light: Light of the scene.

    Attributes:
        image_count: Number of captured images.
    """

    def __init__(self, world: World, config: CellConfig, clock: Clock, seed: int, light: Light) -> None:
        name, self.config = next(iter(config.cameras.items()))
        self.image_count = 0
        self._true_config = world.config.cameras[name]
        self._world = world
        self._clock = clock
        self._seed = seed
        region = (0, 0, self.config.width, self.config.height)
        self._render: Callable[[Array, Pose], RenderedImage]
        if self.config.mount == "fixed" and not light.shadow:
            self._render = FixedViewRenderer(world, region, light).render
        else:
            self._render = partial(render, world, region=region, light=light)

    def get_true_view(self) -> tuple[Array, Pose]:
        """Return the camera matrix `(3, 3)` [pixel] and the pose `X_WC` of the true camera now."""
        return compute_calibration(self._true_config)[0], get_camera_pose(self._world, self._true_config)

    def capture(self) -> CameraImage:
        """Render an image with noise."""
        self.image_count += 1
        self._world.log_command(world_log.CAPTURE)
        image, depth = self._capture_images()
        return CameraImage(image, depth, self._clock.now)

    def _capture_images(self) -> tuple[Image, Array | None]:
        rendered = self._render(*self.get_true_view())
        rng = np.random.default_rng([self._seed, self.image_count])
        image = add_noise(rendered.image, self._true_config.noise, rng)
        if self.config.depth is None:
            return image, None
        rng = np.random.default_rng([self._seed, self.image_count, DEPTH_SEED])
        return image, add_depth_noise(rendered.depth, self.config.depth, rng)
