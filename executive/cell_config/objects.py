"""Objects, bins and the table: what lies where."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from executive.cell_config.section import Colour, Count, Length, Natural, Range, Section, Vector, rising


class ObjectConfig(Section):
    """A class of objects and the model that stands for it in simulation."""

    urdf: str
    """Path of the URDF, looked for beside the cell file and in pybullet_data."""
    scale: float = Field(1.0, gt=0)
    """Factor on the URDF's size."""
    upright_deg: Vector = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw [degree] that set the model upright, where its own z axis does not point up."""
    height: float = Field(gt=0)
    """Height of the object as it lies [m]."""
    radius: float = Field(gt=0)
    """Radius of the circle around its outline seen from above [m]."""
    colours: tuple[Colour, ...] = ((1.0, 1.0, 1.0),)
    """Colours (r, g, b in 0..1) that spawning picks from."""


class BinConfig(Section):
    """A container with a floor and four walls."""

    position: Vector
    """Centre of the floor's underside."""
    size: tuple[Length, Length, Length]
    """Inner length along x, inner width along y, wall height [m]."""
    slots: tuple[Count, Count] = (2, 3)
    """Drop positions along x and y."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Colour of the walls."""


class TableConfig(Section):
    """The table and the part of it where objects lie."""

    x: Range = (0.42, 0.64)
    """Range of the workspace along x [m]."""
    y: Range = (-0.22, 0.22)
    """Range of the workspace along y [m]."""
    objects: Annotated[tuple[Natural, Natural], AfterValidator(rising)] = (3, 6)
    """Fewest and most objects that spawning puts there."""
    gap: float = Field(0.012, ge=0)
    """Smallest distance between the outlines of two objects when spawned [m]."""
