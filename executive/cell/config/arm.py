"""Sections of a cell file: arm, tool and motion."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from executive.cell.config.section import MIN_LENGTH, Angle, Distance, Force, Length, Name, Section

MIN_JOINT_RANGE = 2.0
"""Minimum range of a joint position [degree]; a joint with a smaller range is fixed."""
Speed = Annotated[float, Field(ge=1, le=1000)]
"""[degree/s]; the fastest arms turn a joint by 1000 degrees per second."""
Acceleration = Annotated[float, Field(ge=0.1, le=1000)]
"""[rad/s²]; below 0.1 a motion takes minutes, and 1000 is ten times the acceleration of the fastest arms."""
Jerk = Annotated[float, Field(ge=1, le=1e5)]
"""[rad/s³]; the lower bound reaches 0.1 rad/s² in 0.1 s, the upper bound 1000 rad/s² in 0.01 s."""


class LimitsConfig(Section):
    """Joint limits of the arm, one value for each joint, and their source."""

    source: str
    """Source of the limits."""
    min_position_deg: tuple[Angle, ...] = ()
    """Smallest joint angles [degree]; if empty, the negative of `position_deg`."""
    position_deg: tuple[Angle, ...] = Field(min_length=1)
    """Largest joint angles [degree]."""
    velocity_deg: tuple[Speed, ...]
    """Largest velocity [degree/s]."""
    acceleration: tuple[Acceleration, ...]
    """Largest acceleration [rad/s²]."""
    jerk: tuple[Jerk, ...]
    """Largest jerk [rad/s³]."""
    stop_acceleration: tuple[Acceleration, ...]
    """Largest acceleration while braking [rad/s²]."""
    stop_jerk: tuple[Jerk, ...]
    """Largest jerk while braking [rad/s³]."""

    @property
    def position_ranges_deg(self) -> tuple[tuple[float, float], ...]:
        """Smallest and largest angle of each joint [degree]."""
        lower = self.min_position_deg or tuple(-upper for upper in self.position_deg)
        return tuple(zip(lower, self.position_deg, strict=True))

    @model_validator(mode="after")
    def _check_joints(self) -> LimitsConfig:
        count = len(self.position_deg)
        for name, values in self:
            is_default = name == "min_position_deg" and not values
            if isinstance(values, tuple) and len(values) != count and not is_default:
                raise ValueError(
                    f"has {len(values)} values in {name} and {count} in position_deg; both need one value "
                    "for each joint"
                )
        for joint, (lower, upper) in enumerate(self.position_ranges_deg, start=1):
            if upper - lower < MIN_JOINT_RANGE:
                raise ValueError(
                    f"allows joint {joint} the positions {lower:g} to {upper:g} degrees; the range of a "
                    f"joint must be at least {MIN_JOINT_RANGE:g} degrees"
                )
        return self


class ArmConfig(Section):
    """The arm, its limits and its named poses."""

    urdf: str = "kuka_iiwa/model.urdf"
    """Model of the arm, in pybullet_data. Another arm needs kinematics in `executive/motion/arms.py` and a
    model in `executive/cells/sim/robot_models.py`; supported: `kuka_iiwa/model.urdf` (KUKA LBR iiwa 14)."""
    limits: LimitsConfig
    """Joint limits of the arm."""
    poses_deg: dict[Name, tuple[Angle, ...]] = Field(min_length=1)
    """Named joint poses, one angle for each joint [degree]; a run begins in `home`."""

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.limits.position_deg)

    @model_validator(mode="after")
    def _check_poses(self) -> ArmConfig:
        if "home" not in self.poses_deg:
            raise ValueError(f'needs a pose named "home"; there are: {", ".join(self.poses_deg)}')
        for name, pose in self.poses_deg.items():
            if len(pose) != self.joint_count:
                raise ValueError(
                    f'has {len(pose)} angles in the pose "{name}" and limits of {self.joint_count} joints; '
                    "each needs one value for each joint"
                )
        return self


class ToolConfig(Section):
    """A suction tool with one bellows cup; `tests/benchmarks/suction_map.py` justifies the constants."""

    length: Length = 0.12
    """Distance from the flange to the lip of the cup [m]."""
    cup_radius: Length
    """Radius of the lip [m]."""
    reach: Length = 0.002
    """Largest distance from a surface at which the lip still seals [m]."""
    force: Force
    """Breakaway force of a perfect seal [N]."""
    gap: Length
    """Rim gap at which the breakaway force has fallen to zero [m]."""
    tilt_deg: float = Field(ge=1, lt=90)
    """Angle between surface normal and tool axis at which the breakaway force has fallen to zero [degree]."""
    min_force: Force
    """Breakaway force under which the vacuum sensor reports no seal [N]."""
    source: str
    """Source of the constants."""


class MotionConfig(Section):
    """Parameters of motion planning."""

    margin: Distance = 0.005
    """Smallest distance of arm, tool and load from all obstacles during a motion [m]."""
    clearance: Length = 0.04
    """Clearance above the highest wall and pile in the fallback motion, which stops at every corner and is
    used if no direct motion or detour is collision-free [m]."""
    descent: float = Field(0.005, ge=MIN_LENGTH, le=0.1)
    """Length of the guarded last part of an approach above the expected surface [m]."""
    descent_speed: float = Field(0.035, ge=0.001, le=0.25)
    """Tool speed of the guarded last part of an approach [m/s]; at most the reduced speed of ISO 10218."""
    straight: float = Field(0.0, ge=0, le=0.2)
    """Length of the straight vertical segment at the end of a motion into a bin and at the start of a motion
    upwards [m]."""
    planning_time: float = Field(0.1, ge=0.1, le=60)
    """Time for planning a motion on the clock of the run, unless the motion was planned ahead [s]. The lower
    bound is the 99th percentile of the planning time measured on two cores, 94 ms, rounded up
    (`tests/benchmarks/README.md`)."""
