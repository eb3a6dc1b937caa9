"""Check of each bin in a frame: do its outlines appear at the declared place, in the declared colour?

The chromaticity of a colour is its RGB values divided by their sum; brightness and shading do not change it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.cell.frame import Frame
from executive.cell.objects import BIN_THICKNESS, Bin
from executive.geometry import Array
from executive.perception.camera_check import OutlineFitter, compute_bin_mask, smooth_image
from executive.perception.camera_model import project

MIN_SUPPORT = 0.65
"""Minimum support of a bin at its place (`OutlineFitter.compute_bin_supports`), in both directions."""
MAX_CONTRADICTING_SUPPORT = 0.45
"""Maximum support, in one direction, of a bin that is not at its place."""
MIN_BRIGHTNESS = 60.0
"""Minimum brightness of the brightest tenth of an image that is evidence about bins [grey level]."""
MIN_WALL_PIXELS = 40
"""Minimum number of visible pixels of walls whose colour is compared; every fourth pixel is used."""
MIN_VISIBLE_WALLS = 0.3
"""Minimum visible fraction of the walls in the image whose colour is compared."""
MIN_SATURATION = 0.1
"""Minimum distance of a declared chromaticity from grey at which the colour of a bin is compared."""
MAX_CHROMATICITY_ERROR = 0.3
"""Maximum distance of the chromaticity of the walls from the declared one."""
MIN_CHROMATICITY_GAIN = 0.08
"""Minimum difference between the distances to the declared chromaticities of a bin and of another bin, at
which the walls have the colour of the other bin."""
SEARCH_RADIUS = 0.35
"""Maximum displacement of a bin along each axis that is searched for [m]."""
SEARCH_STEPS = (0.01, 0.002)
"""Distances between the searched places in the two iterations of the search [m]."""
CANNY_THRESHOLDS = (15, 40)
"""Thresholds of the edge detector for the search."""
RIM_FRACTIONS = np.linspace(-1.0, 1.0, 15)
"""Positions of the searched points on each side of a rim, in units of half the side."""
GREY = np.full(3, 1 / 3)
"""Chromaticity of grey."""


def check_bins(frame: Frame, bins: Sequence[Bin]) -> dict[str, str]:
    """Return what a frame shows of bins by name: "" for a bin that is as declared, else a contradiction.

    A bin that the frame does not show well enough is missing in the result.
    """
    verdicts: dict[str, str] = {}
    if np.percentile(frame.image[::8, ::8].max(axis=2), 90) < MIN_BRIGHTNESS:
        return verdicts
    masks = [compute_bin_mask(frame, bin) for bin in bins]
    supports = OutlineFitter(frame, bins).compute_bin_supports(masks)
    for index, bin in enumerate(bins):
        bin_supports = supports[index]
        if np.any(bin_supports <= MAX_CONTRADICTING_SUPPORT):
            verdicts[bin.name] = (
                f"{bin.name} is not at its declared place: the image shows {np.nanmin(bin_supports):.0%} of "
                f"its outlines there, at least {MIN_SUPPORT:.0%} are required; "
                f"{_describe_place(frame, bin, bins)}; put the bin back, or correct the cell file"
            )
            continue
        contradiction = _describe_colour(frame, bins, masks, index)
        if contradiction or (contradiction == "" and np.all(bin_supports >= MIN_SUPPORT)):
            verdicts[bin.name] = contradiction
    return verdicts


def _describe_place(frame: Frame, bin: Bin, bins: Sequence[Bin]) -> str:
    """Return a clause about a place near by with an outline of the size of a bin, outside of other bins."""
    half_size = np.array([*(bin.size[:2] / 2 + BIN_THICKNESS), 0.0])
    sides = [((side, x, 0.0), (x, side, 0.0)) for side in (-1.0, 1.0) for x in RIM_FRACTIONS]
    rim = bin.position + (0.0, 0.0, bin.size[2]) + half_size * np.reshape(sides, (-1, 3))
    edges = cv2.Canny(smooth_image(frame), *CANNY_THRESHOLDS)
    pixels_per_metre = frame.matrix[0, 0] / frame.compute_depth(rim.mean(axis=0))
    shift = np.zeros(3)
    radius = SEARCH_RADIUS
    for step in SEARCH_STEPS:
        offsets = np.arange(-radius, radius + step / 2, step)
        shifts = shift + [(x, y, 0.0) for x in offsets for y in offsets]
        for other in bins:
            distances = np.abs(bin.position + shifts - other.position)[:, :2]
            shifts = shifts[(other is bin) | (distances > other.size[:2] / 2).any(axis=1)]
        pixels = project(frame.matrix, frame.X_WC, (rim + shifts[:, None]).reshape(-1, 3)).astype(int)
        # An edge counts as far as half the way to the next searched place.
        width = 2 * round(step * pixels_per_metre / 2) + 1
        near_edges = cv2.dilate(edges, np.ones((width, width), np.uint8))
        is_inside = ((pixels >= 0) & (pixels < near_edges.shape[::-1])).all(axis=1)
        columns, rows = np.where(is_inside[:, None], pixels, 0).T
        scores = (is_inside & (near_edges[rows, columns] > 0)).reshape(len(shifts), -1).mean(axis=1)
        shift = shifts[int(scores.argmax())]
        radius = step
    moved = replace(bin, position=bin.position + shift)
    supports = OutlineFitter(frame, [moved]).compute_bin_supports([compute_bin_mask(frame, moved)])
    if not np.all(supports >= MIN_SUPPORT):
        return "no outline of its size is near by"
    x, y, _ = 1e3 * shift
    return f"an outline of its size is ({x:+.0f}, {y:+.0f}) mm away"


def _describe_colour(
    frame: Frame, bins: Sequence[Bin], masks: Sequence[NDArray[np.bool_]], index: int
) -> str | None:
    """Return a contradiction if the walls of the bin `index` have another colour than declared, else "".

    None if too little of the walls is visible. A grey bin may have any colour. `masks` show the bins.
    """
    bin = bins[index]
    declared = _compute_chromaticity(bin.colour)
    if np.linalg.norm(declared - GREY) < MIN_SATURATION:
        return ""
    # Objects in the bin hide its floor, but seldom its walls. A quarter of the pixels suffices.
    floor = compute_bin_mask(frame, bin, is_floor=True)
    walls = masks[index][::2, ::2] & ~floor[::2, ::2]
    wall_count = walls.sum()
    walls &= frame.visible[::2, ::2]
    for other_mask in (*masks[:index], *masks[index + 1 :]):
        walls &= ~other_mask[::2, ::2]
    if walls.sum() < max(MIN_WALL_PIXELS, MIN_VISIBLE_WALLS * wall_count):
        return None
    observed = _compute_chromaticity(np.median(frame.image[::2, ::2][walls], axis=0))
    errors = {
        other.name: float(np.linalg.norm(observed - _compute_chromaticity(other.colour))) for other in bins
    }
    nearest = min(errors, key=errors.__getitem__)
    error = errors[bin.name]
    if error <= MAX_CHROMATICITY_ERROR and error - errors[nearest] <= MIN_CHROMATICITY_GAIN:
        return ""
    return (
        f"the bin at the place of {bin.name} has another colour than declared: its shares of red, green and "
        f"blue are {_format_shares(observed)} instead of {_format_shares(declared)}, and the most similar "
        f"declared bin is {nearest}; exchange the bins, or correct the cell file"
    )


def _format_shares(chromaticity: Array) -> str:
    return " / ".join(f"{share:.0%}" for share in chromaticity)


def _compute_chromaticity(colour: ArrayLike) -> Array:
    rgb = np.asarray(colour, dtype=float)
    return np.asarray(rgb / max(rgb.sum(), 1e-9))
