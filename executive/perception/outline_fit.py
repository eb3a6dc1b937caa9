"""Fit of a camera pose to the outlines of the bins in an image.

The outlines of a bin are the border of its outer box in the image and the outer edges of its rim. Image edges
are searched along the normals of the outlines; robust least squares gives the pose.
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
from executive.perception.camera_model import NEAR

MIN_SAMPLES = 60
"""Smallest number of samples in view for an estimate of the pose."""
MIN_NORMAL_EIGENVALUE = 0.12
"""Smallest eigenvalue (0 to 0.5) of the mean outer product of the normals: they must span the image."""
SAMPLE_SPACING = 6.0
"""Distance between two samples of an outline [pixel]."""
BORDER_WIDTH = 4.0
"""Width of the border of an image without samples [pixel]."""
SMOOTHING_STD = 1.0
"""Standard deviation of the Gaussian smoothing before the search for edges [pixel]."""
MIN_CONTRAST = 4.0
"""Smallest contrast of an edge between neighbouring pixels of the smoothed image [grey level]."""
NEAR_RANGES, FAR_RANGES, SUPPORT_RANGE = (8, 4, 3), (16, 8, 4, 3), 2
"""Search distances beside an outline [pixel]: for each step of a fit from the declared pose, for each step
of a fit from a pose of the search grid, and for the support."""
EDGE_STD = 2.0
"""Standard deviation of an edge position [pixel]; large, because the errors of neighbours correlate."""
MIN_OUTLIER = 0.5
"""Smallest residual at which an edge can count as an outlier [pixel]."""
PRIOR_STD = np.full(6, 0.1)
"""Prior standard deviations of the rotation vector [rad] and the translation [m]."""
ROBUST_STEPS = 8
"""Number of iterations of the reweighted least squares."""
TILTS_DEG, ROLLS_DEG = np.arange(-10.0, 11.0), np.arange(-8.0, 9.0, 4.0)
"""Rotations of the search grid about the axes x and y of the camera, and about the optical axis [degree]."""
AXIAL_SHIFTS = np.linspace(-0.21, 0.21, 7)
"""Shifts of the search grid along the optical axis, as shares of the distance of the bins."""
MAX_REFINED = 6
"""Largest number of poses of the search grid that are refined."""
SHRINK, THINNING = 4, 4
"""Factors by which the image is reduced, and the samples are thinned, for the search grid."""


class EdgeSamples(NamedTuple):
    """Samples of the outlines in view of a camera.

    Attributes:
        points: Positions in the world frame `(N, 3)` [m].
        in_camera: Positions in the camera frame `(N, 3)` [m].
        pixels, normals: Image positions [pixel] and unit normals of the outline, each `(N, 2)`.
        bins: Index of the bin of each sample `(N,)`.
    """

    points: Array
    in_camera: Array
    pixels: Array
    normals: Array
    bins: NDArray[np.intp]


class Fit(NamedTuple):
    """A pose fitted to edges.

    Attributes:
        offset: Rotation vector [rad] and translation [m] of the camera in its declared frame `(6,)`.
        covariance: Covariance of `offset` `(6, 6)`.
        samples: Samples of the outlines at this pose.
        support: Share of the samples with an edge nearby (0 to 1).
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

    def refine(self, offset: Array, ranges: Sequence[int] = NEAR_RANGES) -> Fit | None:
        """Return the fit near an offset `(6,)`; None if too few samples or edges are in view."""
        covariance = np.diag(PRIOR_STD**2)
        for max_distance in ranges:
            samples = self._samples_in_view(offset)
            distances, found = self._find_edges(samples, max_distance)
            if not _is_sufficient(samples) or found.sum() < MIN_SAMPLES / 2:
                return None
            jacobian = _compute_jacobian(samples, self._frame.matrix)[found]
            offset, covariance = _solve(jacobian, distances[found], offset, max_distance / 2)
        samples = self._samples_in_view(offset)
        return Fit(offset, covariance, samples, self.support(offset)) if _is_sufficient(samples) else None

    def support(self, offset: Array) -> float:
        """Return the share of the samples in view with an edge nearby (0 to 1)."""
        _, found = self._find_edges(self._samples_in_view(offset), SUPPORT_RANGE)
        return float(found.mean()) if len(found) else 0.0

    def search(self) -> Iterator[Fit]:
        """Yield fits that start from the best poses of a wide grid."""
        small = cv2.resize(self._image, None, fx=1 / SHRINK, fy=1 / SHRINK, interpolation=cv2.INTER_AREA)
        small = cv2.GaussianBlur(small, (0, 0), SMOOTHING_STD).astype(np.float32)
        gradients = np.stack(
            [cv2.Sobel(small, cv2.CV_32F, 1, 0), cv2.Sobel(small, cv2.CV_32F, 0, 1)], axis=-1
        )
        matrix, X_CW, last = self._frame.matrix, self._frame.X_WC.inverse(), np.array(small.shape[1::-1]) - 1
        if not _is_sufficient(self._samples_in_view(np.zeros(6))) or np.abs(gradients).max() < MIN_CONTRAST:
            return
        points, ahead, _ = _sample_outlines(self._bins, self._frame.X_WC, matrix)
        points, ahead = X_CW.apply(points[::THINNING]), X_CW.apply(ahead[::THINNING])
        scored: list[tuple[float, Array]] = []
        for roll, axial_shift in itertools.product(ROLLS_DEG, AXIAL_SHIFTS):
            shift = np.array([0.0, 0.0, axial_shift * points[:, 2].mean()])
            turns = np.radians([(x, y, roll) for x in TILTS_DEG for y in TILTS_DEG])
            rotations = np.stack([cv2.Rodrigues(turn)[0] for turn in turns])
            pixels = _project((points - shift) @ rotations, matrix)
            normals = _find_normals(_project((ahead - shift) @ rotations, matrix) - pixels)
            cells = np.floor(pixels / SHRINK).astype(int)
            inside = ((cells >= 0) & (cells <= last)).all(axis=-1)
            columns, rows = np.moveaxis(cells.clip(0, last), -1, 0)
            strength = np.abs((gradients[rows, columns] * normals[:, :, None]).sum(axis=-1)).sum(axis=-1)
            # The square root gives many weak edges a higher score than a few strong edges.
            score = (np.sqrt(strength) * inside).sum(axis=1) / np.maximum(inside.sum(axis=1), len(points) / 2)
            best = int(score.argmax())
            scored.append((float(score[best]), np.concatenate([turns[best], shift])))
        for _, offset in sorted(scored, key=lambda pair: -pair[0])[:MAX_REFINED]:
            fit = self.refine(offset, FAR_RANGES)
            if fit is not None:
                yield fit

    def _samples_in_view(self, offset: Array) -> EdgeSamples:
        """Return the samples of the outlines in view of a camera at an offset `(6,)`."""
        rotation = np.asarray(cv2.Rodrigues(offset[:3])[0], dtype=float)
        X_WC, visible = self._frame.X_WC @ Pose(rotation, offset[3:]), self._frame.visible
        points, ahead, bins = _sample_outlines(self._bins, X_WC, self._frame.matrix)
        in_camera = X_WC.inverse().apply(points)
        pixels = _project(in_camera, self._frame.matrix)
        normals = _find_normals(_project(X_WC.inverse().apply(ahead), self._frame.matrix) - pixels)
        size = np.array(visible.shape[::-1])
        shown = ((pixels >= BORDER_WIDTH) & (pixels < size - BORDER_WIDTH)).all(axis=1)
        columns, rows = pixels.clip(0, size - 1).astype(int).T
        shown &= visible[rows, columns]
        return EdgeSamples(points[shown], in_camera[shown], pixels[shown], normals[shown], bins[shown])

    def _find_edges(self, samples: EdgeSamples, max_distance: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the distance `(N,)` [pixel] of the strongest edge on each normal, and whether it exists."""
        n = samples.normals[:, None, None]
        across = np.arange(-max_distance - 1.5, max_distance + 2)[:, None, None]
        along = np.array([-2.0, 0.0, 2.0])[:, None] * n[..., ::-1] * (-1, 1)
        # The centres of OpenCV's pixels have integer coordinates.
        places = (samples.pixels[:, None, None] + across * n + along - 0.5).astype(np.float32)
        count, steps, width, _ = places.shape
        places = places.reshape(count, steps * width, 2)
        if not count:
            return np.zeros(0), np.zeros(0, dtype=bool)
        colours = cv2.remap(
            self._image, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        profiles = colours.reshape(count, steps, width, 3).astype(float).mean(axis=2)
        contrast = np.linalg.norm(np.diff(profiles, axis=1), axis=2)
        before, middle, after = contrast[:, :-2], contrast[:, 1:-1], contrast[:, 2:]
        edge = (middle >= before) & (middle > after) & (middle > MIN_CONTRAST)
        each, best = np.arange(count), np.where(edge, middle, 0.0).argmax(axis=1)
        # Vertex of the parabola through the three values around the maximum.
        bend = np.minimum(before - 2 * middle + after, -1e-6)[each, best]
        vertex = 0.5 * (before - after)[each, best] / bend
        return best - max_distance + vertex.clip(-0.5, 0.5), edge[each, best]


def _sample_outlines(bins: Sequence[Bin], X_WC: Pose, matrix: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return samples `(N, 3)` [m] of the outlines, points slightly further along them, and their bins."""
    points, ahead, owners = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, dtype=np.intp)]
    for index, bin in enumerate(bins):
        half = np.array([*(bin.size[:2] / 2 + BIN_THICKNESS), bin.size[2] / 2])
        signs = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
        box = np.array([[*sign, side] for side in (1, -1) for sign in signs])
        corners = bin.position + (0.0, 0.0, half[2]) + half * box
        in_camera = X_WC.inverse().apply(corners)
        if np.any(in_camera[:, 2] < NEAR):
            continue
        pixels = _project(in_camera, matrix)
        border = cv2.convexHull(pixels.astype(np.float32), returnPoints=False)[:, 0].tolist()
        rings = (border, range(4))
        edges = {frozenset(pair) for ring in rings for pair in zip(ring, [*ring[1:], ring[0]], strict=True)}
        for start, end in sorted(sorted(edge) for edge in edges):
            count = int(np.linalg.norm(pixels[end] - pixels[start]) / SAMPLE_SPACING)
            share = ((np.arange(count) + 0.5) / max(count, 1))[:, None]
            points.append(corners[start] + share * (corners[end] - corners[start]))
            ahead.append(corners[start] + (share + 0.01) * (corners[end] - corners[start]))
            owners.append(np.full(count, index, dtype=np.intp))
    return np.concatenate(points), np.concatenate(ahead), np.concatenate(owners)


def _project(in_camera: Array, matrix: Array) -> Array:
    """Project points `(..., 3)` [m] in the camera frame to pixels `(..., 2)`."""
    p = in_camera @ matrix.T
    return np.asarray(p[..., :2] / np.maximum(p[..., 2:], NEAR))


def _find_normals(directions: Array) -> Array:
    """Return unit vectors `(..., 2)` perpendicular to directions in the image."""
    rotated = directions[..., ::-1] * (-1.0, 1.0)
    return np.asarray(rotated / np.maximum(np.linalg.norm(rotated, axis=-1, keepdims=True), 1e-9))


def _is_sufficient(samples: EdgeSamples) -> bool:
    """Return True if there are enough samples and their normals span both directions of the image."""
    count = len(samples.points)
    if count < MIN_SAMPLES:
        return False
    return bool(np.linalg.eigvalsh(samples.normals.T @ samples.normals / count)[0] >= MIN_NORMAL_EIGENVALUE)


def _compute_jacobian(samples: EdgeSamples, matrix: Array) -> Array:
    """Return the Jacobian `(N, 6)` [pixel/rad, pixel/m] of positions along normals w.r.t. the offset."""
    x, y, z = samples.in_camera.T
    u, v = (samples.normals * matrix.diagonal()[:2]).T
    toward = np.column_stack([u / z, v / z, -(u * x + v * y) / z**2])
    return np.column_stack([np.cross(toward, samples.in_camera), -toward])


def _solve(jacobian: Array, distances: Array, offset: Array, scale: float) -> tuple[Array, Array]:
    """Return the offset `(6,)` that fits edges at `distances` `(N,)` [pixel], and its covariance.

    Residuals above `scale` [pixel], or 1.5 times their median magnitude, get little weight.
    """
    change, covariance = np.zeros(6), np.zeros((6, 6))
    for _ in range(ROBUST_STEPS):
        residuals = distances - jacobian @ change
        scale = max(MIN_OUTLIER, min(scale, 1.5 * float(np.median(np.abs(residuals)))))
        weighted = jacobian * ((1 + (residuals / scale) ** 2) ** -2)[:, None] / EDGE_STD**2
        covariance = np.asarray(np.linalg.inv(weighted.T @ jacobian + np.diag(PRIOR_STD**-2.0)), dtype=float)
        change = covariance @ (weighted.T @ distances - offset / PRIOR_STD**2)
    return offset + change, covariance
