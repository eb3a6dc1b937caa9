"""What there is to be seen in a cell, for a person who watches: bodies of simple shape, and where they are.

Nothing here is for the robot: what it knows of the cell it knows from its cameras.
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
    """One solid, fixed to a body.

    Attributes:
        body: Name of the body that it moves with; "" for one that never moves.
        kind: `box`, `cylinder`, `sphere` or `mesh`.
        size: Of a box its lengths, of a cylinder its diameter twice and its height along z, of a sphere its
            diameter three times [m]; of a mesh the scales along its axes.
        X_BS: Where it is in the body's frame.
        colour: Its own.
        file: Of a mesh, in a format that it says by its ending.
    """

    body: str
    kind: str
    size: tuple[float, float, float]
    X_BS: Pose
    colour: Colour
    file: str = ""


class Visuals(Protocol):
    """Everything that there is to be seen."""

    @property
    def shapes(self) -> Sequence[Shape]:
        """Every solid."""

    def poses(self) -> Mapping[str, Pose]:
        """Return where every body is now, by name; one that was taken away is left out."""
