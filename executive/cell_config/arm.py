"""The arm, its tool, and how they move about."""

from __future__ import annotations

from pydantic import Field, model_validator

from executive.cell_config.section import Joints, Limits, Section


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
    """A suction tool with one bellows cup; the constants are justified by the suction map."""

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

    margin: float = Field(0.005, ge=0)
    """Smallest distance of arm, tool and load to anything on the way [m]."""
    clearance: float = Field(0.04, gt=0)
    """Height above walls and objects of a motion that stops at every corner, where no other is clear [m]."""
    descent: float = Field(0.005, gt=0)
    """Length of the guarded last part of an approach above the expected surface [m]."""
    descent_speed: float = Field(0.035, gt=0)
    """Tool speed of the guarded last part of an approach [m/s]."""
    straight: float = Field(0.0, ge=0, le=0.2)
    """Length of the last part of a way into a bin and the first part of a way up that are straight [m]."""
    planning: float = Field(0.05, ge=0)
    """Time that planning a motion takes on the run's clock, unless it was planned ahead [s]."""
