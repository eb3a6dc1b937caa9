"""Classes of objects, bins, and the table."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from executive.cell.config.section import (
    Angles,
    Colour,
    Count,
    Distance,
    Length,
    Natural,
    Range,
    Section,
    Share,
    Vector,
    check_ascending,
)


class ObjectConfig(Section):
    """A class of objects and its model in simulation: a URDF or a mesh."""

    urdf: str = ""
    """Path of a URDF, relative to the cell file or to pybullet_data."""
    mesh: str = ""
    """Path of a Wavefront mesh (`.obj`, z up or `upright_deg`), relative as for `urdf`.
    Each group (`o`) collides as its convex hull: a part with a hole consists of convex groups around it."""
    mass: float = Field(0.05, ge=1e-4, le=1000)
    """Mass of a mesh [kg]; a URDF contains its mass."""
    scale: float = Field(1.0, ge=1e-4, le=1e4)
    """Factor on the model's size; a mesh at scale 1 is in metres."""
    upright_deg: Angles = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw [degree] that set the model upright, if its z axis does not point up."""
    height: Length
    """Height of the object as it lies on the table [m]."""
    radius: Length
    """Radius of the circle around its outline seen from above [m]."""
    ring: Distance = 0.0
    """Distance of the contact point from the centre [m]; for parts with a hole."""
    colours: tuple[Colour, ...] = ((1.0, 1.0, 1.0),)
    """Colours (r, g, b in 0..1) of spawned objects, chosen at random."""

    @model_validator(mode="after")
    def _check_model(self) -> ObjectConfig:
        if bool(self.urdf) == bool(self.mesh):
            raise ValueError("needs either a urdf or a mesh" + (", not both" if self.urdf else ""))
        if self.urdf and "mass" in self.model_fields_set:
            raise ValueError("has a mass, which only a mesh can be given; a URDF says its own")
        if self.ring >= self.radius:
            raise ValueError(
                f"is to be touched {self.ring:g} m from its middle, but its radius is {self.radius:g} m; "
                "ring must be smaller"
            )
        return self


class BinConfig(Section):
    """A container with a floor and four walls."""

    position: Vector
    """Centre of the floor's underside: x, y, z [m]."""
    size: tuple[Length, Length, Length]
    """Inner length along x, inner width along y, wall height [m]."""
    slots: tuple[Count, Count] = (2, 3)
    """Drop positions along x and y."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Colour of the walls."""


class TableConfig(Section):
    """The workspace, the part of the table in which objects lie, and the spawning of objects there."""

    x: Range = (0.42, 0.64)
    """Range of the workspace along x [m]."""
    y: Range = (-0.22, 0.22)
    """Range of the workspace along y [m]."""
    objects: Annotated[tuple[Natural, Natural], AfterValidator(check_ascending)] = (3, 6)
    """Smallest and largest number of spawned objects."""
    gap: Distance = 0.012
    """Smallest distance between the outlines of two spawned objects [m]."""
    stacked: Share = 0.0
    """Share of the objects that are spawned on top of another object, if they stay there."""
