"""Sections of a cell file: classes of objects, bins, and the table."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from executive.cell.config.section import (
    Angles,
    Colour,
    Count,
    Distance,
    Fraction,
    Length,
    Natural,
    Range,
    Section,
    Vector,
    check_ascending,
)


class ObjectConfig(Section):
    """A class of objects, with a URDF or a mesh as its model in simulation."""

    urdf: str = ""
    """Path of a URDF, relative to the cell file or to pybullet_data. The URDF has one link with a mass, whose
    shapes are boxes, cylinders, spheres, capsules, or meshes (`.obj`, `.stl` or `.dae`)."""
    mesh: str = ""
    """Path of a mesh (`.obj`, `.stl` or `.dae`), relative to the cell file or to pybullet_data. The collision
    shape is the convex hull of the mesh, but of each group (`o`) of an `.obj` mesh: a part with a hole needs
    several groups."""
    mass: float | None = Field(None, ge=1e-4, le=1000)
    """Mean mass of the objects [kg]. If not given, a weight is no evidence about the class, and a simulation
    uses the mass in the URDF, or 0.05 kg for a mesh."""
    mass_std: float = Field(0.002, ge=0, le=1000)
    """Standard deviation of the mass between the objects of the class [kg]."""
    looks_like: str = ""
    """Class whose label the detectors report for objects of this class, because both look alike; only the
    weight distinguishes them. If not given, the detectors report the label of this class."""
    scale: float = Field(1.0, ge=1e-4, le=1e4)
    """Scale factor of the model; a mesh at scale 1 is in metres."""
    upright_deg: Angles = (0.0, 0.0, 0.0)
    """Rotation that makes the z axis of the model point up: roll, pitch, yaw [degree]."""
    height: Length
    """Height of the object as it lies on the table [m]."""
    radius: Length
    """Radius of the circle around the outline of the object, seen from above [m]."""
    ring: Distance = 0.0
    """Distance of the contact point from the centre [m]; above 0 only for parts with a hole."""
    colours: tuple[Colour, ...] = ((1.0, 1.0, 1.0),)
    """Colours (red, green, blue, each 0 to 1) from which the colour of each spawned object is drawn."""

    @model_validator(mode="after")
    def _check_model(self) -> ObjectConfig:
        if bool(self.urdf) == bool(self.mesh):
            raise ValueError("needs either a urdf or a mesh" + (", not both" if self.urdf else ""))
        if self.ring >= self.radius:
            raise ValueError(
                f"has a ring of {self.ring:g} m, which must be smaller than the radius, {self.radius:g} m"
            )
        return self


class BinConfig(Section):
    """A container with a floor and four walls."""

    position: Vector
    """Centre of the underside of the floor: x, y, z [m]."""
    size: tuple[Length, Length, Length]
    """Inner length along x, inner width along y, wall height [m]."""
    slots: tuple[Count, Count] = (2, 3)
    """Numbers of drop positions along x and along y."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Colour of the walls."""


class TableConfig(Section):
    """The workspace, which is the region of the table with objects, and the spawning of objects."""

    x: Range = (0.42, 0.64)
    """Range of the workspace along x [m]."""
    y: Range = (-0.22, 0.22)
    """Range of the workspace along y [m]."""
    objects: Annotated[tuple[Natural, Natural], AfterValidator(check_ascending)] = (3, 6)
    """Minimum and maximum number of spawned objects."""
    gap: Distance = 0.012
    """Minimum distance between the outlines of two spawned objects [m]."""
    stacked: Fraction = 0.0
    """Fraction of the objects that are spawned on another object; unstable objects fall down."""
