"""Check of each bin in a frame: its declared place and colour, and what lies on its floor.

The chromaticity of a colour is its RGB values divided by their sum; brightness and shading do not change it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.cell.frame import BinAppearance, Frame
from executive.cell.objects import BIN_THICKNESS, Bin
from executive.geometry import Array
from executive.perception.camera_check import OutlineFitter, compute_bin_mask
from executive.perception.camera_model import compute_hull_mask, project

MIN_SUPPORT = 0.65
"""Minimum support of a bin at its place (`OutlineFitter.compute_bin_supports`), in both directions."""
MAX_CONTRADICTING_SUPPORT = 0.45
"""Maximum support, in one direction, of a bin that is not at its place.

In 65 frames of five cells with bins as declared, empty and filled, the support was at least 0.8. In frames of
fixed cameras, the check contradicted all 24 missing bins and 120 of 128 bins that had moved by 20 to 300 mm.
In 193 frames in the lights of tests/benchmarks/scenes.yaml, only glare led to false contradictions (two).
"""
MIN_BRIGHTNESS = 60.0
"""Minimum brightness of the brightest tenth of an image that is evidence about bins [grey level]."""
MAX_OVEREXPOSED_FRACTION = 0.1
"""Maximum fraction of white pixels at the place of a bin: glare hides outlines, too."""
MIN_PIXELS = 600
"""Minimum number of visible pixels of a bin; a bin with fewer gives no evidence."""
MIN_VISIBLE_FRACTION = 0.3
"""Minimum visible fraction of a bin whose colour is compared."""
MIN_SATURATION = 0.1
"""Minimum distance of a declared chromaticity from grey at which the colour of a bin is compared."""
MAX_CHROMATICITY_ERROR = 0.3
"""Maximum distance of the chromaticity of a bin from the declared one; an orange lamp moves it by 0.18."""
MIN_CHROMATICITY_GAIN = 0.08
"""Minimum difference between the distances to the declared chromaticities of a bin and of another bin, at
which a bin has the colour of the other bin."""
MIN_DISPLACEMENT = 0.012
"""Minimum distance of a bin from its declared place that contradicts [m]; a nearer object still falls in."""
SEARCH_RADIUS = 0.35
"""Maximum displacement of a bin along each axis that is searched for [m]."""
SEARCH_STEPS = (0.01, 0.002)
"""Distances between the searched places in the two iterations of the search [m]."""
CANNY_THRESHOLDS = (15, 40)
"""Thresholds of the edge detector for the search."""
RIM_FRACTIONS = np.linspace(-1.0, 1.0, 15)
"""Positions of the searched points on each side of a rim, in units of half the side."""
REDUCTION = 2
"""Factor that reduces the size of the image for the measurement of contents."""
FLOOR_MARGIN = 0.008
"""Distance of the measured part of a floor from the walls [m]."""
ARM_MARGIN = 0.04
"""Maximum distance by which the arm exceeds the spheres that stand for it in `Frame.visible` [m]."""
MIN_CONTENT_CONTRAST = 14.0
"""Minimum deviation of an object in a bin from the colour of the floor [grey level]."""
MIN_SHOWN_FRACTION = 0.5
"""Minimum visible fraction of a floor whose contents are measured."""
MIN_WHOLE_FRACTION = 0.7
"""Minimum fraction of a floor that a camera sees through the opening, if nothing hides the bin."""
MAX_COVERED_FRACTION = 0.5
"""Maximum covered fraction of a floor, so that the median colour is that of the floor."""
WHITE = 250
"""Minimum value of the channels of a white pixel."""
GREY = np.full(3, 1 / 3)
"""Chromaticity of grey."""


def inspect_bins(frame: Frame, bins: Sequence[Bin]) -> dict[str, BinAppearance]:
    """Return what a frame shows of the bins, by name; a bin of which too little is in view is missing."""
    if not bins or np.percentile(frame.image[::8, ::8].max(axis=2), 90) < MIN_BRIGHTNESS:
        return {}
    depth = min(frame.compute_depth(bin.position) for bin in bins)
    side = 2 * round(ARM_MARGIN * float(frame.matrix[0, 0]) / max(depth, ARM_MARGIN)) + 1
    visible = cv2.erode(frame.visible.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    frame = replace(frame, visible=visible)
    contradictions = _find_contradictions(frame, bins)
    contents = _measure_contents(frame, bins)
    return {
        bin.name: BinAppearance(contradictions.get(bin.name), *contents.get(bin.name, ()))
        for bin in bins
        if bin.name in contradictions or bin.name in contents
    }


def _find_contradictions(frame: Frame, bins: Sequence[Bin]) -> dict[str, str]:
    """Return "" for each bin that a frame shows as declared, and a sentence for each that it contradicts."""
    verdicts: dict[str, str] = {}
    suspects: dict[str, str] = {}
    masks = [compute_bin_mask(frame, bin) for bin in bins]
    fitter = OutlineFitter(frame, bins)
    supports = fitter.compute_bin_supports(masks)
    for index, bin in enumerate(bins):
        bin_supports = supports[index]
        pixels = frame.image[masks[index] & frame.visible]
        if len(pixels) < MIN_PIXELS or (pixels >= WHITE).all(axis=1).mean() > MAX_OVEREXPOSED_FRACTION:
            continue
        if np.any(bin_supports <= MAX_CONTRADICTING_SUPPORT):
            if place := _describe_place(frame, fitter.image, bin, bins):
                verdicts[bin.name] = (
                    f"{bin.name} is not at its declared place: the image shows {np.nanmin(bin_supports):.0%} "
                    f"of its outlines there, at least {MIN_SUPPORT:.0%} are required; {place}; put the bin "
                    "back, or correct the cell file"
                )
            continue
        owner = _find_colour_owner(frame, bins, masks, index)
        if owner not in (None, bin.name):
            text = f"the bin at the place of {bin.name} has the colour of {owner or 'no bin'}"
            verdicts[bin.name] = f"{text}; exchange the bins, or correct the cell file"
            suspects[owner or bin.name] = verdicts[bin.name]
        elif owner == bin.name and np.all(bin_supports >= MIN_SUPPORT):
            verdicts[bin.name] = ""
    # A bin whose colour appears at the place of another one is probably elsewhere, too.
    return suspects | verdicts


def _measure_contents(frame: Frame, bins: Sequence[Bin]) -> dict[str, tuple[float, bool]]:
    """Return the area [m²] that differs from the floor, and if the whole floor is in view, by bin.

    A bin is missing in the result if too little of its floor is in view, or if objects cover most of it.
    """
    contents = {}
    size = (frame.visible.shape[1] // REDUCTION, frame.visible.shape[0] // REDUCTION)
    matrix = frame.matrix.copy()
    matrix[:2] /= REDUCTION
    image = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA).astype(np.int16)
    visible = cv2.resize(frame.visible.astype(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
    for bin in bins:
        half_size = np.array([*(bin.size[:2] / 2 - FLOOR_MARGIN), 0.0])
        rectangle = bin.position + half_size * [(1, 1, 0), (1, -1, 0), (-1, -1, 0), (-1, 1, 0)]
        floor_mask = np.ones(visible.shape, dtype=bool)
        is_cut = False
        # The camera sees the floor through the opening of the bin.
        for z in (BIN_THICKNESS, bin.size[2]):
            polygon = np.add(rectangle, (0.0, 0.0, z))
            pixels = project(matrix, frame.X_WC, polygon)
            is_cut |= bool(np.any((pixels < 0) | (pixels > size)))
            floor_mask &= compute_hull_mask(polygon, matrix, frame.X_WC, size, may_be_cut=True)
        if not floor_mask.any():
            continue
        scale = float(matrix[0, 0]) / frame.compute_depth(bin.position)
        left, top, width, height = cv2.boundingRect(floor_mask.astype(np.uint8))
        crop = np.s_[top : top + height, left : left + width]
        floor_mask = floor_mask[crop]
        shown_mask = floor_mask & visible[crop]
        shown_fraction = shown_mask.sum() / (4 * half_size[0] * half_size[1] * scale**2)
        colours = image[crop][shown_mask]
        if shown_fraction < MIN_SHOWN_FRACTION:
            continue
        deviations = np.abs(image[crop] - np.median(colours, axis=0)).max(axis=2)
        is_different = shown_mask & (deviations > MIN_CONTENT_CONTRAST)
        opened = cv2.morphologyEx(is_different.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        # What touches the hidden part may belong to the arm.
        hidden = cv2.dilate((~visible[crop]).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        labels = cv2.connectedComponents(opened)[1]
        opened[np.isin(labels, labels[hidden])] = 0
        if opened.sum() < MAX_COVERED_FRACTION * len(colours):
            is_hidden = shown_mask.sum() < floor_mask.sum() or shown_fraction <= MIN_WHOLE_FRACTION
            contents[bin.name] = (round(float(opened.sum() / scale**2), 5), not (is_cut or is_hidden))
    return contents


def _describe_place(frame: Frame, smoothed_image: NDArray[np.uint8], bin: Bin, bins: Sequence[Bin]) -> str:
    """Return a clause about the place of a bin, outside of other bins; "" near the declared place."""
    half_size = np.array([*(bin.size[:2] / 2 + BIN_THICKNESS), 0.0])
    sides = [((side, x, 0.0), (x, side, 0.0)) for side in (-1.0, 1.0) for x in RIM_FRACTIONS]
    rim = bin.position + (0.0, 0.0, bin.size[2]) + half_size * np.reshape(sides, (-1, 3))
    edges = cv2.Canny(smoothed_image, *CANNY_THRESHOLDS)
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
        searched_pixels = np.where(is_inside[:, None], pixels, 0)
        has_edge = near_edges[searched_pixels[:, 1], searched_pixels[:, 0]] > 0
        scores = (is_inside & has_edge).reshape(len(shifts), -1).mean(axis=1)
        shift = shifts[int(scores.argmax())]
        radius = step
    moved = replace(bin, position=bin.position + shift)
    supports = OutlineFitter(frame, [moved]).compute_bin_supports([compute_bin_mask(frame, moved)])
    if not np.all(supports >= MIN_SUPPORT):
        return "no outline of its size is near by"
    if np.linalg.norm(shift) <= MIN_DISPLACEMENT:
        return ""
    return f"an outline of its size is ({1e3 * shift[0]:+.0f}, {1e3 * shift[1]:+.0f}) mm away"


def _find_colour_owner(
    frame: Frame, bins: Sequence[Bin], masks: Sequence[NDArray[np.bool_]], index: int
) -> str | None:
    """Return the name of the bin whose declared colour appears at the place of the bin `index`.

    The result is the bin itself if it is grey, "" for a colour of no bin, and None if too little of the bin
    is visible. `masks` show the bins.
    """
    bin = bins[index]
    declared = _compute_chromaticity(bin.colour)
    if np.linalg.norm(declared - GREY) < MIN_SATURATION:
        return bin.name
    # A quarter of the pixels suffices.
    is_shown = masks[index] & frame.visible & (np.sum(masks, axis=0) == 1)
    pixels = frame.image[::2, ::2][is_shown[::2, ::2]]
    if len(pixels) < MIN_VISIBLE_FRACTION * masks[index][::2, ::2].sum():
        return None
    observed = _compute_chromaticity(np.median(pixels, axis=0))
    errors = [float(np.linalg.norm(observed - _compute_chromaticity(other.colour))) for other in bins]
    smallest = min(errors)
    if errors[index] > smallest + MIN_CHROMATICITY_GAIN:
        return bins[errors.index(smallest)].name
    return bin.name if errors[index] <= MAX_CHROMATICITY_ERROR else ""


def _compute_chromaticity(colour: ArrayLike) -> Array:
    rgb = np.asarray(colour, dtype=float)
    return np.asarray(rgb / max(rgb.sum(), 1e-9))
