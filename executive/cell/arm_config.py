"""Data of an arm: content of an arm file, and the section `arm` of a cell file, which an arm file completes.

Each field is a key of `missions/arms/*.yaml`, in SI units. Values of keys that end in `_deg` are in degrees.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field, ValidationInfo, WithJsonSchema, field_validator, model_validator

from executive.cell.device_config import Angle, Angles, Distance, Name, Section, Vector

DEFAULT_ARM_FILE = "arms/iiwa14.yaml"
"""Shipped arm file of cells that name none: the cell files of earlier versions are for this arm."""
TOOL_LINK = "tool"
"""Name of the link of the tool in an arm file and in the simulated arm."""
MIN_JOINT_RANGE = 2.0
"""Minimum range of a joint's positions [degree]; a joint with a smaller range is regarded as fixed."""
Speed = Annotated[float, Field(ge=1, le=1000)]
"""Joint velocity [degree/s]; the fastest arms reach 1000 degree/s."""
Acceleration = Annotated[float, Field(ge=0.1, le=1000)]
"""Joint acceleration [rad/s²]; at 0.1 rad/s², a motion takes minutes; the fastest arms reach 100 rad/s²."""
Jerk = Annotated[float, Field(ge=1, le=1e5)]
"""Joint jerk [rad/s³]; the minimum reaches 0.1 rad/s² in 0.1 s, the maximum 1000 rad/s² in 0.01 s."""
PerJoint = WithJsonSchema(
    {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 1}]}
)
"""JSON schema of values for all joints: the loader of arm files also accepts one number for all joints."""
Torque = Annotated[float, Field(ge=0.1, le=1e5)]
"""Joint torque [Nm], from the torque of a servo for models to that of the arms that lift cars."""
LinkName = Annotated[str, Field(min_length=1, max_length=200)]
"""Name of a link in the URDF."""


class LimitsConfig(Section):
    """Joint limits of the arm and their source; each key has one value for each joint, or one for all."""

    source: str
    """Source of the limits, for instance a data sheet."""
    min_position_deg: Annotated[tuple[Angle, ...], PerJoint] = ()
    """Minimum joint positions [degree]; if empty, the negatives of `position_deg`."""
    position_deg: Annotated[tuple[Angle, ...], PerJoint] = Field(min_length=1)
    """Maximum joint positions [degree]; if not given, both limits are those of the URDF."""
    velocity_deg: Annotated[tuple[Speed, ...], PerJoint]
    """Maximum joint velocities [degree/s]; if not given, those of the URDF."""
    acceleration: Annotated[tuple[Acceleration, ...], PerJoint]
    """Maximum joint accelerations [rad/s²]."""
    jerk: Annotated[tuple[Jerk, ...], PerJoint]
    """Maximum joint jerks [rad/s³]."""
    stop_acceleration: Annotated[tuple[Acceleration, ...], PerJoint]
    """Maximum joint accelerations while the arm brakes [rad/s²]."""
    stop_jerk: Annotated[tuple[Jerk, ...], PerJoint]
    """Maximum joint jerks while the arm brakes [rad/s³]."""

    @property
    def position_ranges_deg(self) -> tuple[tuple[float, float], ...]:
        """Minimum and maximum position of each joint [degree]."""
        lower = self.min_position_deg or tuple(-upper for upper in self.position_deg)
        return tuple(zip(lower, self.position_deg, strict=True))

    @model_validator(mode="after")
    def _check_joints(self) -> LimitsConfig:
        count = len(self.position_deg)
        for name, values in self:
            is_default = name == "min_position_deg" and not values
            if isinstance(values, tuple) and len(values) != count and not is_default:
                problem = f"has {len(values)} values in {name} and {count} in position_deg"
                raise ValueError(f"{problem}; both need one value for each joint")
        for joint, (lower, upper) in enumerate(self.position_ranges_deg, start=1):
            if upper - lower < MIN_JOINT_RANGE:
                problem = f"allows joint {joint} the positions {lower:g} to {upper:g} degrees"
                limit = f"the range of a joint must be at least {MIN_JOINT_RANGE:g} degrees"
                raise ValueError(f"{problem}; {limit}")
        return self


class FlangeConfig(Section):
    """The flange, on which the tool is mounted.

    Its z axis is the axis of the last joint, and points out of the arm.
    """

    link: LinkName
    """Link of the URDF at the flange."""
    rotation_deg: Angles = (0.0, 0.0, 0.0)
    """Rotation from the link to the flange: roll, pitch, yaw [degree]."""
    offset: Distance = 0.0
    """Distance from the origin of the link to the flange along the z axis of the flange [m]."""


class ArmFile(Section):
    """An arm: model, limits and solver. All values are of the arm alone, without its place in a cell."""

    arm: Name
    """Name of the arm."""
    urdf: str = Field(min_length=1)
    """The URDF: a path relative to this file, `package:NAME/path` for a file in an installed Python package,
    or a path relative to pybullet_data. Links beyond the flange, such as a gripper, are left out."""
    flange: FlangeConfig
    """Flange of the arm."""
    limits: LimitsConfig
    """Joint limits of the arm."""
    effort: Annotated[tuple[Torque, ...], PerJoint]
    """Maximum joint torques [Nm]; if not given, those of the URDF."""
    solver: str = "auto"
    """Inverse kinematics of the arm: the name of an entry point of the group `executive.ik_solvers`; `auto`
    is the analytic solver of EAIK if it is installed and knows the arm, otherwise the numeric solver."""
    self_collision_pairs: tuple[tuple[LinkName, LinkName], ...] | None = None
    """Pairs of links that can collide with each other; `tool` is the tool. If not given, the simulator finds
    the pairs in random poses."""

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.limits.position_deg)

    @field_validator("effort")
    @classmethod
    def _check_effort(cls, effort: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        limits: LimitsConfig | None = info.data.get("limits")  # None: the limits are invalid.
        if limits and len(effort) != (count := len(limits.position_deg)):
            raise ValueError(f"needs {count} values, not {len(effort)}, for the joints in limits")
        return effort


class BaseConfig(Section):
    """Place of the base of the arm in the world, whose origin is on the table top."""

    position: Vector = (0.0, 0.0, 0.0)
    """Origin of the base link of the URDF: x, y, z [m]."""
    yaw_deg: Angle = 0.0
    """Rotation of the base about the vertical axis [degree]."""


class ArmConfig(ArmFile):
    """The arm of a cell: named poses, an arm file, and keys that replace keys of the arm file."""

    # The loader inserts the keys of the arm file.
    model_config = ConfigDict(
        json_schema_extra={
            "required": ["poses_deg"],
            "if": {"required": ["file"]},
            "else": {"required": ["limits"]},
        }
    )

    file: str = Field(DEFAULT_ARM_FILE, exclude=True)
    """Path of an arm file, relative to the cell file or to the shipped missions, which supplies all missing
    keys except `poses_deg`. If no file is given, `limits` is required."""
    base: BaseConfig = BaseConfig()
    """Place of the base of the arm in the world."""
    poses_deg: dict[Name, tuple[Angle, ...]] = Field(min_length=1)
    """Named joint configurations, one position for each joint [degree]; a run starts in `home`."""

    @model_validator(mode="after")
    def _check_poses(self) -> ArmConfig:
        if "home" not in self.poses_deg:
            raise ValueError(f'needs a pose named "home"; there are: {", ".join(self.poses_deg)}')
        for name, pose in self.poses_deg.items():
            if len(pose) != self.joint_count:
                angles = f'{len(pose)} angles in the pose "{name}"'
                limits = f"limits of {self.joint_count} joints"
                raise ValueError(f"has {angles} and {limits}; each needs one value for each joint")
        return self
