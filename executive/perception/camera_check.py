"""Check of the frames of a camera: its declared pose against the outlines of the bins, and frozen images.

The outlines of a bin are the silhouette of the outer box and the outer edges of the rim. The fit searches
image edges along the normals of the projected outlines; robust least squares estimates the pose. A pose
offset `(6,)` is the rotation vector [rad] and the translation [m] of a camera from its declared pose. The
support of a pose is the fraction of the outlines (0 to 1) at which the image has an edge.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Frame
from executive.cell.objects import BIN_THICKNESS, Bin
from executive.geometry import Array, Pose
from executive.perception.camera_model import NEAR_PLANE, compute_hull_mask, project

MAX_OUTLINE_DISTANCE = 0.005
"""Maximum mean distance between the outlines of the bins and their expected positions [m].

Measured with cameras at their declared poses: at most 0.6 mm (wrist camera) and 2.1 mm (fixed camera) in 264
frames of eight cells with different light, shadows, tables and fill levels of the bins; at most 0.5 mm (wrist
camera) and 2.2 mm (fixed camera) in the 639 frames of 81 complete runs.
"""
MIN_SUPPORT = 0.65
"""Minimum support of an accepted pose: the fraction of the outlines at which the image has an edge."""
MIN_CERTAIN_SUPPORT = 0.85
"""Minimum support at which a pose near the declared pose is accepted without a search for other poses.

In 250 frames of cameras at their declared poses, the support was at least 0.89. In frames of cameras
displaced by 12 to 60 mm, edges of other objects gave poses near the declared pose a support of up to 0.81.
"""
MIN_SUPPORT_GAIN = 0.15
"""Minimum difference between the support of an accepted pose and the support of the declared pose."""
MIN_SAMPLES = 60
"""Minimum number of visible samples for an estimate of the pose."""
MIN_NORMAL_EIGENVALUE = 0.12
"""Minimum of the smaller eigenvalue (0 to 0.5) of the mean outer product of the normals; 0 if all normals are
parallel, so that the image does not determine the pose."""
MIN_BIN_SAMPLES = 10
"""Minimum number of visible samples for the support of one bin in one direction."""
SAMPLE_SPACING = 6.0
"""Distance between neighbouring samples of an outline [pixel]."""
BORDER_WIDTH = 4.0
"""Width of the border of the image in which samples are ignored [pixel]."""
SMOOTHING_STD = 1.0
"""Standard deviation of the Gaussian filter that smooths the image before the search for edges [pixel]."""
MIN_CONTRAST = 4.0
"""Minimum difference between neighbouring pixels of the smoothed image at an edge [grey level]."""
FIT_EDGE_DISTANCES = (8, 4, 3)
"""Maximum distances between outline and edge in the iterations of a fit from the declared pose [pixel]."""
SEARCH_EDGE_DISTANCES = (16, 8, 4, 3)
"""Maximum distances between outline and edge in the iterations of a fit from the search grid [pixel]."""
SUPPORT_EDGE_DISTANCE = 2
"""Maximum distance between outline and edge for the support of a pose [pixel]."""
EDGE_STD = 2.0
"""Standard deviation of an edge position [pixel]; large, because errors of neighbouring edges correlate."""
MIN_OUTLIER_RESIDUAL = 0.5
"""Minimum residual of an edge that is treated as an outlier [pixel]."""
PRIOR_STD = np.full(6, 0.1)
"""Prior standard deviations of the rotation vector [rad] and the translation [m]."""
REWEIGHTING_ITERATIONS = 8
"""Number of iterations of iteratively reweighted least squares."""
TILTS_DEG = np.arange(-10.0, 11.0)
"""Rotations of the search grid about the axes x and y of the camera [degree]."""
ROLLS_DEG = np.arange(-8.0, 9.0, 4.0)
"""Rotations of the search grid about the optical axis [degree]."""
AXIAL_SHIFTS = np.linspace(-0.21, 0.21, 7)
"""Translations of the search grid along the optical axis, as fractions of the mean distance of the bins."""
MAX_REFINED_POSES = 6
"""Maximum number of poses of the search grid that are refined."""
REDUCTION = 4
"""Factor that reduces the size of the image and the number of samples for the search grid."""
CHANGE_CELL = 8
"""Side of the cells over which images are averaged before their comparison [pixel]."""
MIN_CHANGE = 4.0
"""Minimum difference between the means of a changed cell in two images [grey level]."""
MIN_MOVED_CELLS = 100
"""Minimum number of cells through which the arm moved for a comparison."""
MIN_CHANGED_FRACTION = 0.05
"""Minimum fraction of the cells through which the arm moved that change; in 21 runs of sort_overhead,
sort_wrist and sort_stacked, it was at least 0.34 in every frame."""
MIN_CAMERA_MOTION = 0.01
"""Minimum distance between two poses of a moving camera at which the whole image changes [m]."""


@dataclass(frozen=True, eq=False)
class CameraOffset:
    """Estimated displacement of a camera from its declared pose.

    Attributes:
        shift: Translation in the world `(3,)` [m].
        rotation_deg: Angle of the rotation from the declared to the estimated pose [degree].
        outline_distance: Mean distance between the outlines of the bins and their expected positions [m].
        bins: Names of the bins in view.
    """

    shift: Array
    rotation_deg: float
    outline_distance: float
    bins: tuple[str, ...]


def describe_displacement(frame: Frame, bins: Sequence[Bin]) -> str:
    """Return a message about the displacement of a camera, or "" if the frame shows no displacement."""
    offset = estimate_offset(frame, bins)
    if offset is None or offset.outline_distance <= MAX_OUTLINE_DISTANCE:
        return ""
    x, y, z = 1e3 * offset.shift
    return (
        f"camera {frame.camera} is not at its declared pose: the outlines of {', '.join(offset.bins)} "
        f"appear {1e3 * offset.outline_distance:.0f} mm away from their expected positions, as if the camera "
        f"had moved by ({x:+.0f}, {y:+.0f}, {z:+.0f}) mm and turned by {offset.rotation_deg:.1f} degrees; "
        f"limit {1e3 * MAX_OUTLINE_DISTANCE:.0f} mm; mount camera and bins as declared, or measure it again"
    )


def describe_standstill(frame: Frame, previous: Frame) -> str:
    """Return a sentence if a frame shows that the camera repeats the previous frame, or "".

    A new image has other noise, and shows the motion of the arm and of a camera at the wrist.
    """
    problem = f"camera {frame.camera} is frozen, restart it: frame {frame.id}"
    if np.array_equal(frame.image, previous.image):
        return f"{problem} has the same pixels as frame {previous.id}, which was captured earlier"
    has_camera_moved = np.linalg.norm(frame.X_WC.position - previous.X_WC.position) > MIN_CAMERA_MOTION
    region = (frame.visible != previous.visible) | has_camera_moved
    size = (frame.image.shape[1] // CHANGE_CELL, frame.image.shape[0] // CHANGE_CELL)
    # The means of cells have hardly any noise, and the factor removes a common change of brightness.
    new = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    old = cv2.resize(previous.image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    is_moved = cv2.resize(255 * region.astype(np.uint8), size, interpolation=cv2.INTER_AREA) > 127
    factor = float((new * old).sum() / max(float((old * old).sum()), 1.0))
    is_changed = np.abs(new - factor * old).max(axis=-1)[is_moved] > MIN_CHANGE
    if len(is_changed) < MIN_MOVED_CELLS or is_changed.mean() >= MIN_CHANGED_FRACTION:
        return ""
    return (
        f"{problem} differs from frame {previous.id} in {is_changed.mean():.1%} of the region through which "
        f"the arm or the camera moved; at least {MIN_CHANGED_FRACTION:.0%} are expected"
    )


def estimate_offset(frame: Frame, bins: Sequence[Bin]) -> CameraOffset | None:
    """Return the offset of a camera from its declared pose; None if the image does not determine it."""
    fitter = OutlineFitter(frame, bins)
    near_fit = fitter.refine(np.zeros(6))
    if near_fit is not None and near_fit.support >= MIN_CERTAIN_SUPPORT:
        offset = _make_camera_offset(near_fit, frame, bins)
        if offset.outline_distance <= MAX_OUTLINE_DISTANCE:
            return offset
    else:
        # If half of the bins are at their declared places, the camera is right, and other bins were moved.
        supports = fitter.compute_bin_supports([compute_bin_mask(frame, bin) for bin in bins])
        has_support = np.fmin.reduce(supports, axis=1) >= MIN_CERTAIN_SUPPORT
        visible_count = (~np.isnan(supports).all(axis=1)).sum()
        if has_support.any() and 2 * has_support.sum() >= visible_count:
            return None
    # The edges near the expected outlines may belong to other objects, so that other poses are tried too.
    fits = [fit for fit in (near_fit, *fitter.search()) if fit is not None]
    best_fit = max(fits, key=lambda fit: fit.support, default=None)
    min_support = max(MIN_SUPPORT, fitter.compute_support(np.zeros(6)) + MIN_SUPPORT_GAIN)
    if best_fit is None or best_fit.support < min_support:
        return None
    return _make_camera_offset(best_fit, frame, bins)


def _make_camera_offset(fit: PoseFit, frame: Frame, bins: Sequence[Bin]) -> CameraOffset:
    samples = fit.samples
    expected_pixels = project(frame.matrix, frame.X_WC, samples.world_points)
    distances = np.linalg.norm(samples.pixels - expected_pixels, axis=1)
    return CameraOffset(
        shift=frame.X_WC.rotation @ fit.offset[3:],
        rotation_deg=math.degrees(float(np.linalg.norm(fit.offset[:3]))),
        outline_distance=float((distances * samples.camera_points[:, 2]).mean() / frame.matrix[0, 0]),
        bins=tuple(bins[index].name for index in np.unique(samples.bin_indices)),
    )


def compute_bin_mask(frame: Frame, bin: Bin) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the pixels of a bin."""
    size = (frame.visible.shape[1], frame.visible.shape[0])
    return compute_hull_mask(list_corners(bin), frame.matrix, frame.X_WC, size, may_be_cut=True)


class EdgeSamples(NamedTuple):
    """Visible samples of the outlines.

    Attributes:
        world_points: Positions in the world frame `(N, 3)` [m].
        camera_points: Positions in the camera frame `(N, 3)` [m].
        pixels: Positions in the image `(N, 2)` [pixel].
        normals: Unit normals of the outlines in the image `(N, 2)`.
        bin_indices: Index of the bin of each sample `(N,)`.
    """

    world_points: Array
    camera_points: Array
    pixels: Array
    normals: Array
    bin_indices: NDArray[np.intp]


class PoseFit(NamedTuple):
    """A camera pose fitted to the edges of an image.

    Attributes:
        offset: Pose offset `(6,)`.
        samples: Visible samples of the outlines at the fitted pose.
        support: Support of the fitted pose.
    """

    offset: Array
    samples: EdgeSamples
    support: float


class OutlineFitter:
    """Fits camera poses to the edges of one frame.

    Attributes:
        image: The image of the frame after a Gaussian filter `(H, W, 3)`.
    """

    def __init__(self, frame: Frame, bins: Sequence[Bin]) -> None:
        self._frame = frame
        self._bins = bins
        self.image = np.asarray(cv2.GaussianBlur(frame.image, (0, 0), SMOOTHING_STD), dtype=np.uint8)

    def refine(self, offset: Array, max_distances: Sequence[int] = FIT_EDGE_DISTANCES) -> PoseFit | None:
        """Return the fit that starts at a pose offset; None if too few samples or edges are visible.

        `max_distances` are the maximum distances between outline and edge in the iterations [pixel].
        """
        for max_distance in max_distances:
            samples = self._find_visible_samples(offset)
            distances, has_edge = self._find_edges(samples, max_distance)
            if not _is_sufficient(samples) or has_edge.sum() < MIN_SAMPLES / 2:
                return None
            jacobian = _compute_jacobian(samples, self._frame.matrix)[has_edge]
            offset = _solve_robustly(jacobian, distances[has_edge], offset, max_distance / 2)
        samples = self._find_visible_samples(offset)
        if not _is_sufficient(samples):
            return None
        return PoseFit(offset, samples, self.compute_support(offset))

    def compute_support(self, offset: Array) -> float:
        """Return the support of the pose with the given offset."""
        _, has_edge = self._find_edges(self._find_visible_samples(offset), SUPPORT_EDGE_DISTANCE)
        return float(has_edge.mean()) if len(has_edge) else 0.0

    def compute_bin_supports(self, masks: Sequence[NDArray[np.bool_]]) -> Array:
        """Return the support of each bin at the declared pose by direction of the normals `(B, 2)`.

        Normals along the columns of the image are in column 0, normals along its rows in column 1: a bin that
        has moved along one of its sides still covers the outlines of this side. Outlines behind another bin
        do not count. A value is NaN if fewer than `MIN_BIN_SAMPLES` samples are visible. `masks` are the
        results of `compute_bin_mask`.
        """
        samples = self._find_visible_samples(np.zeros(6))
        _, has_edge = self._find_edges(samples, SUPPORT_EDGE_DISTANCE)
        columns, rows = samples.pixels.astype(int).T
        is_in_other_bin = np.zeros(len(has_edge), dtype=bool)
        for index, mask in enumerate(masks):
            is_in_other_bin |= mask[rows, columns] & (samples.bin_indices != index)
        groups = 2 * samples.bin_indices + (np.abs(samples.normals[:, 0]) > np.abs(samples.normals[:, 1]))
        counts = np.bincount(groups[~is_in_other_bin], minlength=2 * len(self._bins))
        edge_counts = np.bincount(groups[~is_in_other_bin & has_edge], minlength=2 * len(self._bins))
        supports = np.where(counts >= MIN_BIN_SAMPLES, edge_counts / np.maximum(counts, 1), np.nan)
        return supports.reshape(-1, 2)

    def search(self) -> Iterator[PoseFit]:
        """Yield fits that start at the poses of the search grid with the strongest edges at the outlines."""
        scale = 1 / REDUCTION
        small_image = cv2.resize(self.image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        small_image = cv2.GaussianBlur(small_image, (0, 0), SMOOTHING_STD).astype(np.float32)
        derivatives = [cv2.Sobel(small_image, cv2.CV_32F, *orders) for orders in ((1, 0), (0, 1))]
        gradients = np.stack(derivatives, axis=-1)
        matrix = self._frame.matrix
        last_pixel = np.array(small_image.shape[1::-1]) - 1
        samples = self._find_visible_samples(np.zeros(6))
        if not _is_sufficient(samples) or np.abs(gradients).max() < MIN_CONTRAST:
            return
        *world_points, _ = _sample_outlines(self._bins, self._frame.X_WC, matrix)
        X_CW = self._frame.X_WC.inverse()
        points, next_points = (X_CW.apply(values[::REDUCTION]) for values in world_points)
        scored_offsets: list[tuple[float, Array]] = []
        for roll, axial_shift in itertools.product(ROLLS_DEG, AXIAL_SHIFTS):
            shift = np.array([0.0, 0.0, axial_shift * points[:, 2].mean()])
            rotation_vectors = np.radians([(x, y, roll) for x in TILTS_DEG for y in TILTS_DEG])
            rotations = np.stack([cv2.Rodrigues(vector)[0] for vector in rotation_vectors])
            pixels = _project((points - shift) @ rotations, matrix)
            normals = _compute_normals(_project((next_points - shift) @ rotations, matrix) - pixels)
            small_pixels = np.floor(pixels / REDUCTION).astype(int)
            is_inside = ((small_pixels >= 0) & (small_pixels <= last_pixel)).all(axis=-1)
            columns, rows = np.moveaxis(small_pixels.clip(0, last_pixel), -1, 0)
            contrast = np.abs((gradients[rows, columns] * normals[:, :, None]).sum(axis=-1)).sum(axis=-1)
            # The square root gives many weak edges a higher score than a few strong edges.
            inside_count = np.maximum(is_inside.sum(axis=1), len(points) / 2)
            scores = (np.sqrt(contrast) * is_inside).sum(axis=1) / inside_count
            best = int(scores.argmax())
            scored_offsets.append((float(scores[best]), np.concatenate([rotation_vectors[best], shift])))
        for _, offset in sorted(scored_offsets, key=lambda pair: -pair[0])[:MAX_REFINED_POSES]:
            if fit := self.refine(offset, SEARCH_EDGE_DISTANCES):
                yield fit

    def _find_visible_samples(self, offset: Array) -> EdgeSamples:
        """Return the samples of the outlines that are visible from the pose with the given offset."""
        rotation = np.asarray(cv2.Rodrigues(offset[:3])[0], dtype=float)
        X_WC = self._frame.X_WC @ Pose(rotation, offset[3:])
        world_points, next_points, bin_indices = _sample_outlines(self._bins, X_WC, self._frame.matrix)
        camera_points = X_WC.inverse().apply(world_points)
        pixels = _project(camera_points, self._frame.matrix)
        normals = _compute_normals(_project(X_WC.inverse().apply(next_points), self._frame.matrix) - pixels)
        size = np.array(self._frame.visible.shape[::-1])
        is_visible = ((pixels >= BORDER_WIDTH) & (pixels < size - BORDER_WIDTH)).all(axis=1)
        columns, rows = pixels.clip(0, size - 1).astype(int).T
        is_visible &= self._frame.visible[rows, columns]
        samples = EdgeSamples(world_points, camera_points, pixels, normals, bin_indices)
        return EdgeSamples(*(values[is_visible] for values in samples))

    def _find_edges(self, samples: EdgeSamples, max_distance: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the distances `(N,)` [pixel] along the normals to edges; True for samples with an edge."""
        if not len(samples.pixels):
            return np.zeros(0), np.zeros(0, dtype=bool)
        normals = samples.normals[:, None, None]
        normal_steps = np.arange(-max_distance - 1.5, max_distance + 2)[:, None, None] * normals
        tangent_steps = np.array([-2.0, 0.0, 2.0])[:, None] * normals[..., ::-1] * (-1, 1)
        # Pixel centres have integer coordinates in OpenCV.
        positions = (samples.pixels[:, None, None] + normal_steps + tangent_steps - 0.5).astype(np.float32)
        count, length, width, _ = positions.shape
        x, y = positions.reshape(count, length * width, 2).transpose(2, 0, 1)
        colours = cv2.remap(self.image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        profiles = colours.reshape(count, length, width, 3).astype(float).mean(axis=2)
        contrast = np.linalg.norm(np.diff(profiles, axis=1), axis=2)
        previous = contrast[:, :-2]
        current = contrast[:, 1:-1]
        following = contrast[:, 2:]
        is_edge = (current >= previous) & (current > following) & (current > MIN_CONTRAST)
        strongest = np.where(is_edge, current, 0.0).argmax(axis=1)
        edge_index = (np.arange(count), strongest)
        # The vertex of the parabola through three contrasts is the edge position with subpixel accuracy.
        curvature = np.minimum(previous - 2 * current + following, -1e-6)[edge_index]
        vertex = 0.5 * (previous - following)[edge_index] / curvature
        return strongest - max_distance + vertex.clip(-0.5, 0.5), is_edge[edge_index]


def _sample_outlines(bins: Sequence[Bin], X_WC: Pose, matrix: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return points `(N, 3)` [m] on the outlines, neighbouring points for the tangents, and bin indices."""
    points = [np.zeros((0, 3))]
    next_points = [np.zeros((0, 3))]
    bin_indices = [np.zeros(0, dtype=np.intp)]
    for index, bin in enumerate(bins):
        corners = list_corners(bin)
        corners_C = X_WC.inverse().apply(corners)
        if np.any(corners_C[:, 2] < NEAR_PLANE):
            continue
        pixels = _project(corners_C, matrix)
        silhouette = cv2.convexHull(pixels.astype(np.float32), returnPoints=False)[:, 0].tolist()
        closed_polygons: tuple[list[int], ...] = ([*silhouette, silhouette[0]], [0, 1, 2, 3, 0])
        edges = {frozenset(edge) for polygon in closed_polygons for edge in itertools.pairwise(polygon)}
        for start, end in sorted(sorted(edge) for edge in edges):
            count = int(np.linalg.norm(pixels[end] - pixels[start]) / SAMPLE_SPACING)
            fractions = ((np.arange(count) + 0.5) / max(count, 1))[:, None]
            points.append(corners[start] + fractions * (corners[end] - corners[start]))
            next_points.append(corners[start] + (fractions + 0.01) * (corners[end] - corners[start]))
            bin_indices.append(np.full(count, index, dtype=np.intp))
    return np.concatenate(points), np.concatenate(next_points), np.concatenate(bin_indices)


def list_corners(bin: Bin) -> Array:
    """Return the corners of the outer box of a bin `(8, 3)` [m]; the first four belong to the rim."""
    half_size = np.array([*(bin.size[:2] / 2 + BIN_THICKNESS), bin.size[2] / 2])
    signs = [(*xy, z) for z in (1, -1) for xy in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    return np.asarray(bin.position + (0.0, 0.0, half_size[2]) + half_size * signs)


def _project(camera_points: Array, matrix: Array) -> Array:
    """Return the image positions `(..., 2)` [pixel] of points `(..., 3)` [m] in the camera frame."""
    p = camera_points @ matrix.T
    return np.asarray(p[..., :2] / np.maximum(p[..., 2:], NEAR_PLANE))


def _compute_normals(directions: Array) -> Array:
    """Return unit vectors `(..., 2)` perpendicular to directions in the image."""
    normals = directions[..., ::-1] * (-1.0, 1.0)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9))


def _is_sufficient(samples: EdgeSamples) -> bool:
    """Return True if there are enough samples with normals in different directions."""
    count = len(samples.pixels)
    if count < MIN_SAMPLES:
        return False
    return bool(np.linalg.eigvalsh(samples.normals.T @ samples.normals / count)[0] >= MIN_NORMAL_EIGENVALUE)


def _compute_jacobian(samples: EdgeSamples, matrix: Array) -> Array:
    """Return the derivatives `(N, 6)` of image positions along the normals by the pose offset."""
    x, y, z = samples.camera_points.T
    u, v = (samples.normals * matrix.diagonal()[:2]).T
    # Derivative of n·f·(x/z, y/z) by the point (x, y, z), with the normal n and the focal length f.
    gradient = np.column_stack([u / z, v / z, -(u * x + v * y) / z**2])
    # A camera that moves by (w, t) moves the point by -(w × p + t) in the camera frame.
    return np.column_stack([np.cross(gradient, samples.camera_points), -gradient])


def _solve_robustly(jacobian: Array, distances: Array, offset: Array, scale: float) -> Array:
    """Return the pose offset that fits edges at `distances` `(N,)` [pixel].

    Maximum a posteriori estimate with Geman-McClure weights: edges with residuals above `scale` [pixel], or
    above 1.5 times the median residual, get a low weight.
    """
    correction = np.zeros(6)
    for _ in range(REWEIGHTING_ITERATIONS):
        residuals = distances - jacobian @ correction
        scale = max(MIN_OUTLIER_RESIDUAL, min(scale, 1.5 * float(np.median(np.abs(residuals)))))
        weights = (1 + (residuals / scale) ** 2) ** -2
        weighted = jacobian * weights[:, None] / EDGE_STD**2
        covariance = np.linalg.inv(weighted.T @ jacobian + np.diag(PRIOR_STD**-2.0))
        correction = covariance @ (weighted.T @ distances - offset / PRIOR_STD**2)
    return np.asarray(offset + correction)
