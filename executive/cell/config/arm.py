"""Sections of a cell file: arm, tool and motion."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from executive.cell.config.section import MIN_LENGTH, Angle, Distance, Force, Length, Name, Section

MIN_JOINT_RANGE = 2.0
"""Minimum range of a joint's positions [degree]; a joint with a smaller range is regarded as fixed."""
Speed = Annotated[float, Field(ge=1, le=1000)]
"""Joint velocity [degree/s]; the fastest arms reach 1000 degree/s."""
Acceleration = Annotated[float, Field(ge=0.1, le=1000)]
"""Joint acceleration [rad/s²]; at 0.1 rad/s², a motion takes minutes; the fastest arms reach 100 rad/s²."""
Jerk = Annotated[float, Field(ge=1, le=1e5)]
"""Joint jerk [rad/s³]; the minimum reaches 0.1 rad/s² in 0.1 s, the maximum 1000 rad/s² in 0.01 s."""


class LimitsConfig(Section):
    """Joint limits of the arm, one value for each joint, and their source."""

    source: str
    """Source of the limits, for instance a data sheet."""
    min_position_deg: tuple[Angle, ...] = ()
    """Minimum joint positions [degree]; if empty, the negatives of `position_deg`."""
    position_deg: tuple[Angle, ...] = Field(min_length=1)
    """Maximum joint positions [degree]."""
    velocity_deg: tuple[Speed, ...]
    """Maximum joint velocities [degree/s]."""
    acceleration: tuple[Acceleration, ...]
    """Maximum joint accelerations [rad/s²]."""
    jerk: tuple[Jerk, ...]
    """Maximum joint jerks [rad/s³]."""
    stop_acceleration: tuple[Acceleration, ...]
    """Maximum joint accelerations while the arm brakes [rad/s²]."""
    stop_jerk: tuple[Jerk, ...]
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


class ArmConfig(Section):
    """The arm, its limits and its named poses."""

    urdf: str = "kuka_iiwa/model.urdf"
    """Model of the arm, in pybullet_data. Another arm needs kinematics in `executive/motion/arms.py` and a
    model in `executive/cells/sim/world.py`; supported: `kuka_iiwa/model.urdf` (KUKA LBR iiwa 14)."""
    limits: LimitsConfig
    """Joint limits of the arm."""
    poses_deg: dict[Name, tuple[Angle, ...]] = Field(min_length=1)
    """Named joint configurations, one position for each joint [degree]; a run starts in `home`."""

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
                angles = f'{len(pose)} angles in the pose "{name}"'
                limits = f"limits of {self.joint_count} joints"
                raise ValueError(f"has {angles} and {limits}; each needs one value for each joint")
        return self


class ToolConfig(Section):
    """A suction tool with one bellows cup; `tests/benchmarks/suction_map.py` justifies the constants."""

    length: Length = 0.12
    """Distance from the flange to the lip of the cup [m]."""
    cup_radius: Length
    """Radius of the lip [m]."""
    reach: Length = 0.002
    """Maximum distance between lip and surface at which the lip seals [m]."""
    force: Force
    """Breakaway force of a perfect seal [N]."""
    gap: Length
    """Gap between lip and surface at which the breakaway force is zero [m]."""
    tilt_deg: float = Field(ge=1, lt=90)
    """Angle between surface normal and tool axis at which the breakaway force is zero [degree]."""
    min_force: Force
    """Minimum breakaway force at which the vacuum sensor reports a seal [N]."""
    load_std: float = Field(0.05, gt=0, le=100)
    """Standard deviation of a reading of the load [N]. The default is assumed: 0.5 % of 10 N, the range of a
    small load cell."""
    source: str
    """Source of the constants."""


class MotionConfig(Section):
    """Parameters of motion planning."""

    margin: Distance = 0.005
    """Minimum distance of arm, tool and load from all obstacles during a motion [m]."""
    clearance: Length = 0.04
    """Clearance over the highest wall and pile [m] in the fallback motion, which stops at every corner and is
    used if no other motion is collision-free."""
    descent: float = Field(0.005, ge=MIN_LENGTH, le=0.1)
    """Height above the expected surface at which the guarded descent of an approach starts [m]."""
    slow_descent: float = Field(0.001, ge=MIN_LENGTH, le=0.1)
    """Height above the expected surface from which the guarded descent is slow [m], at most `descent`, if a
    touch has confirmed the height of the class; else, the whole guarded descent is slow. The default is the
    distance at which the simulated tool feels a surface."""
    descent_speed: float = Field(0.035, ge=0.001, le=0.25)
    """Tool speed of the slow part of the guarded descent [m/s]; the maximum is the reduced speed of ISO
    10218."""
    straight: float = Field(0.0, ge=0, le=0.2)
    """Length of the straight vertical segment at the end of a motion into a bin, and at the start of a motion
    that begins upwards [m]."""
    planning_time: float = Field(0.1, ge=0.1, le=60)
    """Planning time of a motion that was not planned ahead, on the clock of the run [s]. The lower bound is
    the measured 99th percentile of the planning time, 94 ms, rounded up (`tests/benchmarks/README.md`)."""
