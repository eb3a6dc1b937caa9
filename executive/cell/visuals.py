"""Shapes and poses of the bodies in a cell, for displays.

Skills never use these true poses; the robot knows objects only from its cameras.
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
    """A solid that is fixed to a body.

    Attributes:
        body: Name of the body; "" for a solid that never moves.
        kind: `box`, `cylinder`, `sphere` or `mesh`.
        size: Size along x, y and z [m]; for a mesh, scale factors along x, y and z.
        X_BS: Pose of the shape in the frame of the body.
        colour: Colour.
        file: File of a mesh, whose suffix names the format; "" for other kinds.
    """

    body: str
    kind: str
    size: tuple[float, float, float]
    X_BS: Pose
    colour: Colour
    file: str = ""


class Visuals(Protocol):
    """Everything that displays show of a cell."""

    @property
    def shapes(self) -> Sequence[Shape]:
        """All solids."""

    def poses(self) -> Mapping[str, Pose]:
        """Return the present pose of each body by name; removed bodies are left out."""
