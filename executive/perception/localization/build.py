"""The localizer that a cell file names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from executive.cell.objects import ObjectClass
from executive.cell.protocols import Localizer
from executive.perception.localization.depth import DepthLocalizer
from executive.perception.localization.plane import PlaneLocalizer
from executive.perception.localization.ray import Cast, RayLocalizer


def build_localizer(
    way: Literal["plane", "depth", "ray"], classes: Mapping[str, ObjectClass], cast: Cast
) -> Localizer:
    """Return what localizes that way; `cast` is the simulator's ray test, for `ray` alone."""
    if way == "depth":
        return DepthLocalizer(classes)
    return RayLocalizer(classes, cast) if way == "ray" else PlaneLocalizer(classes)
