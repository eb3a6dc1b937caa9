"""The typed content of a cell file: where a mission happens and what stands there.

The model is the file: every field below is a key of `missions/cells/*.yaml`, in SI units. Keys that
end in `_deg` are in degrees, where the field says so.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Number = TypeVar("Number", int, float)


def _rising(pair: tuple[Number, Number]) -> tuple[Number, Number]:
    if pair[0] > pair[1]:
        raise ValueError(f"must not fall: {pair[0]:g} stands before {pair[1]:g}")
    return pair


Length = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
Natural = Annotated[int, Field(ge=0)]
Range = Annotated[tuple[float, float], AfterValidator(_rising)]
Vector = Annotated[tuple[float, float, float], Field(description="x, y, z [m]")]
Joints = tuple[float, float, float, float, float, float, float]
Limits = tuple[Length, Length, Length, Length, Length, Length, Length]
Colour = tuple[float, float, float]


class Section(BaseModel):
    """A part of a cell file: unknown keys are errors, values do not change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


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
    objects: Annotated[tuple[Natural, Natural], AfterValidator(_rising)] = (3, 6)
    """Fewest and most objects that spawning puts there."""
    gap: float = Field(0.012, ge=0)
    """Smallest distance between the outlines of two objects when spawned [m]."""


class NoiseConfig(Section):
    """Sensor noise of a camera, drawn anew for every frame from the run's seed."""

    gain: float = Field(0.02, ge=0)
    """Standard deviation of a frame's brightness factor."""
    read: float = Field(2.0, ge=0)
    """Standard deviation of a pixel's value [grey level of 255]."""


class CameraConfig(Section):
    """A camera, fixed in the world or mounted on the wrist."""

    mount: Literal["fixed", "wrist"]
    """`fixed`: `position` and `look_at` are in the world. `wrist`: they are in the flange's frame."""
    position: Vector
    """Optical centre."""
    look_at: Vector
    """A point on the optical axis."""
    up: Vector
    """Direction that the top of the image shows."""
    width: int = Field(640, ge=64)
    """Image width [pixel]."""
    height: int = Field(480, ge=64)
    """Image height [pixel]."""
    fov_deg: float = Field(gt=1, lt=179)
    """Vertical field of view [degree]."""
    table_view: tuple[int, int, int, int]
    """Left, top, right, bottom [pixel] of the square part of the image that shows the workspace."""
    scan_poses: tuple[str, ...] = Field(min_length=1)
    """Arm poses from which it sees the table, best first."""
    noise: NoiseConfig = NoiseConfig()
    """Its sensor noise."""

    @model_validator(mode="after")
    def _can_be_set_up(self) -> CameraConfig:
        left, top, right, bottom = self.table_view
        square = 0 <= left < right <= self.width and 0 <= top < bottom <= self.height
        if not square or right - left != bottom - top:
            raise ValueError(
                f"needs a table_view that is a square inside its image of {self.width} x {self.height} "
                f"pixels, not {list(self.table_view)}"
            )
        if np.linalg.norm(np.cross(np.subtract(self.look_at, self.position), self.up)) < 1e-9:
            raise ValueError("needs a look_at other than its position, and an up that is not on its axis")
        return self


class DetectorConfig(Section):
    """A detector: what kind, and what it needs."""

    model_config = ConfigDict(extra="allow", frozen=True, use_attribute_docstrings=True)

    kind: str
    """Name of an installed detector (entry-point group `executive.detectors`)."""
    threshold: float = Field(0.5, gt=0, lt=1)
    """Confidence from which a detection counts."""
    floor: float = Field(0.25, gt=0, lt=1)
    """Confidence under which a box is ignored altogether."""
    latency: float = Field(0.05, ge=0)
    """Time from a frame to its answer on the run's clock [s]."""

    @model_validator(mode="after")
    def _is_floored(self) -> DetectorConfig:
        if self.floor > self.threshold:
            raise ValueError(f"needs a floor up to its threshold, {self.threshold:g}, not {self.floor:g}")
        return self

    @property
    def options(self) -> dict[str, Any]:
        """The keys that only this kind of detector knows."""
        return dict(self.model_extra or {})


class LimitsConfig(Section):
    """Joint limits of the arm, shape (7,) each, with where they come from."""

    source: str
    """Where the figures were taken from."""
    position_deg: Limits
    """Largest joint angle to either side [degree]."""
    velocity_deg: Limits
    """[degree/s]"""
    acceleration: Limits
    """[rad/s²]"""
    jerk: Limits
    """[rad/s³]"""
    stop_acceleration: Limits
    """Largest acceleration while braking [rad/s²]."""
    stop_jerk: Limits
    """Largest jerk while braking [rad/s³]."""


class ArmConfig(Section):
    """The arm, its limits and its named poses."""

    urdf: str = "kuka_iiwa/model.urdf"
    """Model of the arm, in pybullet_data."""
    limits: LimitsConfig
    """What it may do."""
    poses_deg: dict[str, Joints] = Field(min_length=1)
    """Named joint poses; `home` is where a run begins."""

    @model_validator(mode="after")
    def _has_home(self) -> ArmConfig:
        if "home" not in self.poses_deg:
            raise ValueError(f'needs a pose named "home"; there are: {", ".join(self.poses_deg)}')
        return self


class ToolConfig(Section):
    """A suction tool with one bellows cup; the constants are justified by the seal map."""

    length: float = Field(0.12, gt=0)
    """From the flange to the cup's lip [m]."""
    cup_radius: float = Field(gt=0)
    """Radius of the lip [m]."""
    reach: float = Field(0.002, gt=0)
    """Largest distance at which the lip still closes on a surface [m]."""
    force: float = Field(gt=0)
    """Breakaway force of a perfect seal [N]."""
    gap: float = Field(gt=0)
    """Rim gap at which the breakaway force has fallen to zero [m]."""
    tilt_deg: float = Field(gt=0, lt=90)
    """Angle between surface normal and tool axis at which it has fallen to zero [degree]."""
    least_force: float = Field(gt=0)
    """Breakaway force under which the vacuum sensor reports no seal [N]."""
    source: str
    """Where the constants come from."""


class MotionConfig(Section):
    """How the arm moves about the cell."""

    clearance: float = Field(0.04, gt=0)
    """Height that tool and load keep above walls and objects while travelling [m]."""
    descent_speed: float = Field(0.03, gt=0)
    """Tool speed of the guarded last part of an approach [m/s]."""
    descent: float = Field(0.02, gt=0)
    """Length of the guarded last part above the expected surface [m]."""
    margin: float = Field(0.005, ge=0)
    """Smallest distance of arm and tool to the cell along a checked path [m]."""


class LedgerConfig(Section):
    """When the ledger believes what."""

    gate: float = Field(0.025, gt=0)
    """Largest distance between a detection and the item it is bound to [m]."""
    neighbourhood: float = Field(0.07, ge=0)
    """Radius around a picked item in which others may have been moved [m]."""
    looks_to_believe: int = Field(2, ge=1)
    """Looks at the full frame that must agree before the table is believed empty."""


class CellConfig(Section):
    """A whole cell file."""

    base: str = Field("", exclude=True)
    """Another cell file, which gives every key of the first level that this one does not; "" once it has."""
    cell: str
    """Name of the cell."""
    description: str = ""
    """One sentence."""
    kind: str = "sim"
    """Kind of cell (entry-point group `executive.cells`)."""
    arm: ArmConfig
    tool: ToolConfig
    motion: MotionConfig = MotionConfig()
    table: TableConfig = TableConfig()
    bins: dict[str, BinConfig] = Field(min_length=1)
    cameras: dict[str, CameraConfig] = Field(min_length=1, max_length=1)
    detectors: dict[str, DetectorConfig] = Field(min_length=1)
    localization: Literal["plane", "depth", "ray"] = "plane"
    objects: dict[str, ObjectConfig] = Field(min_length=1)
    ledger: LedgerConfig = LedgerConfig()
    safe_place: Vector
    """Where something held may be put down on the table."""
