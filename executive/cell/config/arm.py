"""Sections of a cell file: arm, tool and motion."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from executive.cell.config.section import MIN_LENGTH, Distance, Force, Joints, Length, Name, Section

MaxJointAngle = Annotated[float, Field(ge=1, le=360)]
"""Largest joint angle to either side [degree]: under 1 degree a joint is fixed."""
Speed = Annotated[float, Field(ge=1, le=1000)]
"""[degree/s]; the fastest arms turn a joint by 1000 degrees per second."""
Acceleration = Annotated[float, Field(ge=0.1, le=1000)]
"""[rad/s²]; below 0.1 a motion takes minutes, and 1000 is ten times the acceleration of the fastest arms."""
Jerk = Annotated[float, Field(ge=1, le=1e5)]
"""[rad/s³]; the lower bound reaches 0.1 rad/s² in 0.1 s, the upper bound 1000 rad/s² in 0.01 s."""
MaxJointAngles = tuple[
    MaxJointAngle, MaxJointAngle, MaxJointAngle, MaxJointAngle, MaxJointAngle, MaxJointAngle, MaxJointAngle
]
Speeds = tuple[Speed, Speed, Speed, Speed, Speed, Speed, Speed]
Accelerations = tuple[
    Acceleration, Acceleration, Acceleration, Acceleration, Acceleration, Acceleration, Acceleration
]
Jerks = tuple[Jerk, Jerk, Jerk, Jerk, Jerk, Jerk, Jerk]


class LimitsConfig(Section):
    """Joint limits of the arm, shape (7,) each, and their source."""

    source: str
    """Source of the limits."""
    position_deg: MaxJointAngles
    """Largest joint angle to either side [degree]."""
    velocity_deg: Speeds
    """[degree/s]"""
    acceleration: Accelerations
    """[rad/s²]"""
    jerk: Jerks
    """[rad/s³]"""
    stop_acceleration: Accelerations
    """Largest acceleration while braking [rad/s²]."""
    stop_jerk: Jerks
    """Largest jerk while braking [rad/s³]."""


class ArmConfig(Section):
    """The arm, its limits and its named poses."""

    urdf: str = "kuka_iiwa/model.urdf"
    """Model of the arm, in pybullet_data."""
    limits: LimitsConfig
    """Joint limits of the arm."""
    poses_deg: dict[Name, Joints] = Field(min_length=1)
    """Named joint poses; `home` is where a run begins."""

    @model_validator(mode="after")
    def _has_home(self) -> ArmConfig:
        if "home" not in self.poses_deg:
            raise ValueError(f'needs a pose named "home"; there are: {", ".join(self.poses_deg)}')
        return self


class ToolConfig(Section):
    """A suction tool with one bellows cup; `tests/benchmarks/suction_map.py` justifies the constants."""

    length: Length = 0.12
    """From the flange to the cup's lip [m]."""
    cup_radius: Length
    """Radius of the lip [m]."""
    reach: Length = 0.002
    """Largest distance at which the lip still closes on a surface [m]."""
    force: Force
    """Breakaway force of a perfect seal [N]."""
    gap: Length
    """Rim gap at which the breakaway force has fallen to zero [m]."""
    tilt_deg: float = Field(ge=1, lt=90)
    """Angle between surface normal and tool axis at which the breakaway force has fallen to zero [degree]."""
    least_force: Force
    """Breakaway force under which the vacuum sensor reports no seal [N]."""
    source: str
    """Source of the constants."""


class MotionConfig(Section):
    """Parameters of motion planning."""

    margin: Distance = 0.005
    """Smallest distance of arm, tool and load to anything on the way [m]."""
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
    planning: float = Field(0.1, ge=0.1, le=60)
    """Time that planning a motion takes on the run's clock, unless it was planned ahead [s]. Its lower
    bound is the 99th percentile of the planning time measured on two cores, 94 ms, rounded up
    (`tests/benchmarks/README.md`)."""
