"""Shapes and true poses of the bodies in a cell, for displays.

Skills have no access to true poses; they detect objects in camera images.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from executive.geometry import Pose

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""


@dataclass(frozen=True)
class Shape:
    """A solid shape that is rigidly attached to a body.

    Attributes:
        body: Name of the body; "" for a shape that never moves.
        kind: Kind of shape: `box`, `cylinder`, `sphere` or `mesh`.
        size: Size along x, y and z [m]; for a mesh, scale factors along x, y and z.
        X_BS: Pose of the shape in the frame of the body.
        colour: Colour of the surface.
        file: Path of the file of a mesh, with the suffix of its format; "" for other kinds.
    """

    body: str
    kind: str
    size: tuple[float, float, float]
    X_BS: Pose
    colour: Colour
    file: str = ""


class Visuals(Protocol):
    """Shapes of a cell and their poses, for displays."""

    @property
    def shapes(self) -> Sequence[Shape]:
        """All shapes of the cell."""

    def poses(self) -> Mapping[str, Pose]:
        """Return the current pose `X_WB` of each body by name, without removed bodies."""
