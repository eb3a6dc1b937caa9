"""What a labelled image knows beyond its labels: the frame it is, and which objects are in full view."""

from __future__ import annotations

import numpy as np

from executive.cell.frame import Box, Frame
from executive.geometry import Array, Pose
from executive.training.samples import LabelledImage

INSIDE = 0.5
"""Distance from the border of what is searched [pixel] from which an object is wholly in view."""
VISIBLE = 0.9
"""Share of its silhouette that must show for an object to be in full view."""


def as_frame(sample: LabelledImage, number: int) -> Frame:
    """Return the image as the frame of a camera that shows just this, with the renderer's camera if known."""
    truth = sample.truth
    known = "matrix" in truth and "X_WC" in truth
    return Frame(
        id=number,
        camera=str(truth.get("camera", "image")),
        image=sample.image,
        depth=sample.depth,
        matrix=_matrix(sample) if known else np.eye(3),
        X_WC=Pose.of(truth["X_WC"][:3], truth["X_WC"][3:]) if known else Pose.identity(),
        stamp=0.0,
        visible=np.ones(sample.image.shape[:2], np.bool_),
        epoch=0,
    )


def is_whole(box: Box, sample: LabelledImage) -> bool:
    """Tell whether a box of the sample lies wholly in what is searched."""
    height, width = sample.image.shape[:2]
    left, top, right, bottom = sample.area or (0, 0, width, height)
    return min(box[0] - left, box[1] - top, right - box[2], bottom - box[3]) >= INSIDE


def visible_fraction(sample: LabelledImage, number: int) -> float:
    """Return which share of an object shows, 0 to 1; 1 where that is not known."""
    shares = sample.truth.get("visible_fraction")
    return 1.0 if shares is None else float(shares[number])


def in_full_view(sample: LabelledImage, number: int) -> bool:
    """Tell whether an object lies wholly in what is searched, with next to nothing before it."""
    return is_whole(sample.boxes[number], sample) and visible_fraction(sample, number) >= VISIBLE


def pixel_size(sample: LabelledImage) -> Array:
    """Return width and height of the image's pixels `(2,)` in pixels of the camera's whole frame."""
    height, width = sample.image.shape[:2]
    left, top, right, bottom = sample.truth.get("part", (0, 0, width, height))
    return np.array([(right - left) / width, (bottom - top) / height])


def _matrix(sample: LabelledImage) -> Array:
    """Return the camera matrix of the part of the camera's image that the sample shows."""
    left, top, *_ = sample.truth.get("part", (0, 0))
    shifted = np.array(sample.truth["matrix"], dtype=float)
    shifted[:2, 2] -= left, top
    shifted[:2] /= pixel_size(sample)[:, None]
    return shifted
