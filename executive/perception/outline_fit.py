"""Estimation of a camera pose from the outlines of the bins in an image.

The outlines of a bin are the silhouette of its outer box, and the outer edges of its rim. Edges of the
image are searched along the normals of the projected outlines; robust least squares estimates the pose.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.frame import Frame
from executive.geometry import Array, Pose
from executive.perception.camera_model import NEAR_PLANE

MIN_SAMPLES = 60
"""Minimum number of visible samples for an estimate of the pose."""
MIN_NORMAL_EIGENVALUE = 0.12
"""Minimum of the smaller eigenvalue (0 to 0.5) of the mean outer product of the normals: they must point in
different directions."""
SAMPLE_SPACING = 6.0
"""Distance between neighbouring samples of an outline [pixel]."""
BORDER_WIDTH = 4.0
"""Width of the border of the image in which samples are ignored [pixel]."""
SMOOTHING_STD = 1.0
"""Standard deviation of the Gaussian filter that smooths the image before the search for edges [pixel]."""
MIN_CONTRAST = 4.0
"""Minimum difference between neighbouring pixels of the smoothed image at an edge [grey level]."""
FIT_EDGE_DISTANCES, SEARCH_EDGE_DISTANCES, SUPPORT_EDGE_DISTANCE = (8, 4, 3), (16, 8, 4, 3), 2
"""Maximum distances between outline and edge [pixel]: in each iteration of a fit from the declared pose, in
each iteration of a fit from a pose of the search grid, and for the support of a pose."""
EDGE_STD = 2.0
"""Standard deviation of an edge position [pixel]; large, because errors of neighbouring samples correlate."""
MIN_OUTLIER_RESIDUAL = 0.5
"""Minimum residual of an edge that is treated as an outlier [pixel]."""
PRIOR_STD = np.full(6, 0.1)
"""Prior standard deviations of the rotation vector [rad] and the translation [m]."""
REWEIGHTING_ITERATIONS = 8
"""Number of iterations of the iteratively reweighted least squares."""
TILTS_DEG, ROLLS_DEG = np.arange(-10.0, 11.0), np.arange(-8.0, 9.0, 4.0)
"""Rotations of the search grid about the axes x and y of the camera, and about the optical axis [degree]."""
AXIAL_SHIFTS = np.linspace(-0.21, 0.21, 7)
"""Translations of the search grid along the optical axis, as fractions of the mean distance of the bins."""
MAX_REFINED_POSES = 6
"""Maximum number of poses of the search grid that are refined."""
IMAGE_REDUCTION, SAMPLE_REDUCTION = 4, 4
"""Factors by which the image size and the number of samples are reduced for the search grid."""


class EdgeSamples(NamedTuple):
    """Visible samples of the outlines.

    Attributes:
        points: Positions in the world frame `(N, 3)` [m].
        in_camera: Positions in the camera frame `(N, 3)` [m].
        pixels, normals: Image positions [pixel] and unit normals of the outlines in the image, each `(N, 2)`.
        bins: Index of the bin of each sample `(N,)`.
    """

    points: Array
    in_camera: Array
    pixels: Array
    normals: Array
    bins: NDArray[np.intp]


class PoseFit(NamedTuple):
    """A camera pose fitted to the edges of an image.

    Attributes:
        offset: Rotation vector [rad] and translation [m] of the camera from its declared pose `(6,)`.
        covariance: Covariance of `offset` `(6, 6)`.
        samples: Samples of the outlines at this pose.
        support: Fraction of the samples (0 to 1) with an edge within `SUPPORT_EDGE_DISTANCE`.
    """

    offset: Array
    covariance: Array
    samples: EdgeSamples
    support: float


class OutlineFitter:
    """Fits camera poses to the edges of one frame."""

    def __init__(self, frame: Frame, bins: Sequence[Bin]) -> None:
        self._frame, self._bins = frame, bins
        self._image = cv2.GaussianBlur(frame.image, (0, 0), SMOOTHING_STD)

    def refine(self, offset: Array, ranges: Sequence[int] = FIT_EDGE_DISTANCES) -> PoseFit | None:
        """Return the fit that starts at an offset `(6,)`; None if too few samples or edges are visible."""
        covariance = np.diag(PRIOR_STD**2)
        for max_distance in ranges:
            samples = self._find_visible_samples(offset)
            distances, found = self._find_edges(samples, max_distance)
            if not _is_sufficient(samples) or found.sum() < MIN_SAMPLES / 2:
                return None
            jacobian = _compute_jacobian(samples, self._frame.matrix)[found]
            offset, covariance = _solve_robustly(jacobian, distances[found], offset, max_distance / 2)
        samples = self._find_visible_samples(offset)
        if not _is_sufficient(samples):
            return None
        return PoseFit(offset, covariance, samples, self.compute_support(offset))

    def compute_support(self, offset: Array) -> float:
        """Return the fraction of the visible samples (0 to 1) with an edge within `SUPPORT_EDGE_DISTANCE`."""
        _, found = self._find_edges(self._find_visible_samples(offset), SUPPORT_EDGE_DISTANCE)
        return float(found.mean()) if len(found) else 0.0

    def search(self) -> Iterator[PoseFit]:
        """Yield fits that start at the poses of the search grid with the strongest image edges."""
        small_image = cv2.resize(
            self._image, None, fx=1 / IMAGE_REDUCTION, fy=1 / IMAGE_REDUCTION, interpolation=cv2.INTER_AREA
        )
        small_image = cv2.GaussianBlur(small_image, (0, 0), SMOOTHING_STD).astype(np.float32)
        gradients = np.stack(
            [cv2.Sobel(small_image, cv2.CV_32F, 1, 0), cv2.Sobel(small_image, cv2.CV_32F, 0, 1)], axis=-1
        )
        matrix, X_CW, last = (
            self._frame.matrix,
            self._frame.X_WC.inverse(),
            np.array(small_image.shape[1::-1]) - 1,
        )
        if (
            not _is_sufficient(self._find_visible_samples(np.zeros(6)))
            or np.abs(gradients).max() < MIN_CONTRAST
        ):
            return
        points, next_points, _ = _sample_outlines(self._bins, self._frame.X_WC, matrix)
        points, next_points = (
            X_CW.apply(points[::SAMPLE_REDUCTION]),
            X_CW.apply(next_points[::SAMPLE_REDUCTION]),
        )
        scored_offsets: list[tuple[float, Array]] = []
        for roll, axial_shift in itertools.product(ROLLS_DEG, AXIAL_SHIFTS):
            shift = np.array([0.0, 0.0, axial_shift * points[:, 2].mean()])
            rotation_vectors = np.radians([(x, y, roll) for x in TILTS_DEG for y in TILTS_DEG])
            rotations = np.stack([cv2.Rodrigues(vector)[0] for vector in rotation_vectors])
            pixels = _project((points - shift) @ rotations, matrix)
            normals = _compute_normals(_project((next_points - shift) @ rotations, matrix) - pixels)
            small_pixels = np.floor(pixels / IMAGE_REDUCTION).astype(int)
            inside = ((small_pixels >= 0) & (small_pixels <= last)).all(axis=-1)
            columns, rows = np.moveaxis(small_pixels.clip(0, last), -1, 0)
            strength = np.abs((gradients[rows, columns] * normals[:, :, None]).sum(axis=-1)).sum(axis=-1)
            # The square root gives many weak edges a higher score than a few strong edges.
            score = (np.sqrt(strength) * inside).sum(axis=1) / np.maximum(inside.sum(axis=1), len(points) / 2)
            best = int(score.argmax())
            scored_offsets.append((float(score[best]), np.concatenate([rotation_vectors[best], shift])))
        for _, offset in sorted(scored_offsets, key=lambda pair: -pair[0])[:MAX_REFINED_POSES]:
            fit = self.refine(offset, SEARCH_EDGE_DISTANCES)
            if fit is not None:
                yield fit

    def _find_visible_samples(self, offset: Array) -> EdgeSamples:
        """Return the samples of the outlines that a camera at an offset `(6,)` shows."""
        rotation = np.asarray(cv2.Rodrigues(offset[:3])[0], dtype=float)
        X_WC, visible = self._frame.X_WC @ Pose(rotation, offset[3:]), self._frame.visible
        points, next_points, bins = _sample_outlines(self._bins, X_WC, self._frame.matrix)
        in_camera = X_WC.inverse().apply(points)
        pixels = _project(in_camera, self._frame.matrix)
        normals = _compute_normals(_project(X_WC.inverse().apply(next_points), self._frame.matrix) - pixels)
        size = np.array(visible.shape[::-1])
        is_shown = ((pixels >= BORDER_WIDTH) & (pixels < size - BORDER_WIDTH)).all(axis=1)
        columns, rows = pixels.clip(0, size - 1).astype(int).T
        is_shown &= visible[rows, columns]
        return EdgeSamples(*(values[is_shown] for values in (points, in_camera, pixels, normals, bins)))

    def _find_edges(self, samples: EdgeSamples, max_distance: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the distance `(N,)` [pixel] along each normal to the strongest edge, and a mask of hits."""
        n = samples.normals[:, None, None]
        across = np.arange(-max_distance - 1.5, max_distance + 2)[:, None, None]
        along = np.array([-2.0, 0.0, 2.0])[:, None] * n[..., ::-1] * (-1, 1)
        # Pixel centres have integer coordinates in OpenCV.
        positions = (samples.pixels[:, None, None] + across * n + along - 0.5).astype(np.float32)
        count, steps, width, _ = positions.shape
        positions = positions.reshape(count, steps * width, 2)
        if not count:
            return np.zeros(0), np.zeros(0, dtype=bool)
        colours = cv2.remap(
            self._image,
            positions[..., 0],
            positions[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        profiles = colours.reshape(count, steps, width, 3).astype(float).mean(axis=2)
        contrast = np.linalg.norm(np.diff(profiles, axis=1), axis=2)
        before, middle, after = contrast[:, :-2], contrast[:, 1:-1], contrast[:, 2:]
        is_edge = (middle >= before) & (middle > after) & (middle > MIN_CONTRAST)
        each, best = np.arange(count), np.where(is_edge, middle, 0.0).argmax(axis=1)
        # The parabola through the three values around the maximum gives the edge position below one pixel.
        curvature = np.minimum(before - 2 * middle + after, -1e-6)[each, best]
        vertex = 0.5 * (before - after)[each, best] / curvature
        return best - max_distance + vertex.clip(-0.5, 0.5), is_edge[each, best]


def _sample_outlines(bins: Sequence[Bin], X_WC: Pose, matrix: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return points `(N, 3)` [m] on the outlines, the points slightly further along, and the bin indices."""
    points, next_points, bin_indices = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, dtype=np.intp)]
    for index, bin in enumerate(bins):
        half = np.array([*(bin.size[:2] / 2 + BIN_THICKNESS), bin.size[2] / 2])
        signs = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
        box = np.array([[*sign, side] for side in (1, -1) for sign in signs])
        corners = bin.position + (0.0, 0.0, half[2]) + half * box
        in_camera = X_WC.inverse().apply(corners)
        if np.any(in_camera[:, 2] < NEAR_PLANE):
            continue
        pixels = _project(in_camera, matrix)
        silhouette = cv2.convexHull(pixels.astype(np.float32), returnPoints=False)[:, 0].tolist()
        loops = (silhouette, range(4))
        edges = {frozenset(pair) for loop in loops for pair in zip(loop, [*loop[1:], loop[0]], strict=True)}
        for start, end in sorted(sorted(edge) for edge in edges):
            count = int(np.linalg.norm(pixels[end] - pixels[start]) / SAMPLE_SPACING)
            fraction = ((np.arange(count) + 0.5) / max(count, 1))[:, None]
            points.append(corners[start] + fraction * (corners[end] - corners[start]))
            next_points.append(corners[start] + (fraction + 0.01) * (corners[end] - corners[start]))
            bin_indices.append(np.full(count, index, dtype=np.intp))
    return np.concatenate(points), np.concatenate(next_points), np.concatenate(bin_indices)


def _project(in_camera: Array, matrix: Array) -> Array:
    """Return the image positions `(..., 2)` [pixel] of points `(..., 3)` [m] in the camera frame."""
    p = in_camera @ matrix.T
    return np.asarray(p[..., :2] / np.maximum(p[..., 2:], NEAR_PLANE))


def _compute_normals(directions: Array) -> Array:
    """Return unit vectors `(..., 2)` perpendicular to directions in the image."""
    rotated = directions[..., ::-1] * (-1.0, 1.0)
    return np.asarray(rotated / np.maximum(np.linalg.norm(rotated, axis=-1, keepdims=True), 1e-9))


def _is_sufficient(samples: EdgeSamples) -> bool:
    """Return True if there are enough samples, and their normals have different directions."""
    count = len(samples.points)
    if count < MIN_SAMPLES:
        return False
    return bool(np.linalg.eigvalsh(samples.normals.T @ samples.normals / count)[0] >= MIN_NORMAL_EIGENVALUE)


def _compute_jacobian(samples: EdgeSamples, matrix: Array) -> Array:
    """Return the Jacobian `(N, 6)` [pixel/rad, pixel/m] of positions along the normals by the offset."""
    x, y, z = samples.in_camera.T
    u, v = (samples.normals * matrix.diagonal()[:2]).T
    gradient = np.column_stack([u / z, v / z, -(u * x + v * y) / z**2])
    return np.column_stack([np.cross(gradient, samples.in_camera), -gradient])


def _solve_robustly(jacobian: Array, distances: Array, offset: Array, scale: float) -> tuple[Array, Array]:
    """Return the offset `(6,)` that fits edges at `distances` `(N,)` [pixel], and its covariance `(6, 6)`.

    Edges with residuals above `scale` [pixel], or above 1.5 times the median residual, get a low weight.
    """
    change, covariance = np.zeros(6), np.zeros((6, 6))
    for _ in range(REWEIGHTING_ITERATIONS):
        residuals = distances - jacobian @ change
        scale = max(MIN_OUTLIER_RESIDUAL, min(scale, 1.5 * float(np.median(np.abs(residuals)))))
        weighted = jacobian * ((1 + (residuals / scale) ** 2) ** -2)[:, None] / EDGE_STD**2
        covariance = np.asarray(np.linalg.inv(weighted.T @ jacobian + np.diag(PRIOR_STD**-2.0)), dtype=float)
        change = covariance @ (weighted.T @ distances - offset / PRIOR_STD**2)
    return offset + change, covariance
