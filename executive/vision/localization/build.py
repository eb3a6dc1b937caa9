"""The localizer that a cell file names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from executive.cell import Localizer
from executive.messages import ObjectClass
from executive.vision.localization.depth import DepthLocalizer
from executive.vision.localization.plane import PlaneLocalizer
from executive.vision.localization.ray import Cast, RayLocalizer


def build_localizer(
    way: Literal["plane", "depth", "ray"], classes: Mapping[str, ObjectClass], cast: Cast
) -> Localizer:
    """Return what localizes that way; `cast` is the simulator's ray test, for `ray` alone."""
    if way == "depth":
        return DepthLocalizer(classes)
    return RayLocalizer(classes, cast) if way == "ray" else PlaneLocalizer(classes)
