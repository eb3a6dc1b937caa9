"""Gripper with two parallel fingers: section, parts, grasps with the yaw of the object, and evidence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from executive.arms.urdf import ATTACHED_PREFIX, find_model, parse_numbers, read_robot
from executive.cell.arm import Goal
from executive.cell.device_config import Angles, Distance, Force, Length, MotionConfig, Section
from executive.cell.objects import ObjectClass, Target
from executive.cell.tools import GraspAttempt, GraspPose, ToolMeasurement, ToolModel, ToolPart
from executive.errors import Blocked, InputError
from executive.geometry import Yaw
from executive.text.findings import suggest_choice

if TYPE_CHECKING:
    from executive.drivers.sim.fingers import SimFingers
    from executive.drivers.sim.world import World

FINGER_JOINTS = ("tool_finger_1", "tool_finger_2")
"""Names of the joints of the fingers; each position is half of the opening [m]."""
MIN_TIP_HEIGHT = 0.008
"""Minimum height of the tips above the support of the object [m]: 3 mm more than the default margin of cell
files. Tips that press on a table cannot close."""
TIP_CLEARANCE = 0.002
"""Distance between the tips and the top of an object at the start of the descent, beyond the margin of the
cell file [m]."""
PALM_CLEARANCE = 0.003
"""Minimum distance between the palm and the top of a held object [m]."""
MIN_ALLOWANCE = 0.004
"""Minimum distance of each open finger from an object that the gripper is declared to hold [m]."""
MIN_OVERLAP = 0.004
"""Minimum height of the part of an object between the pads [m]."""
MIN_GRIP_WIDTH = 0.002
"""Minimum distance of fingers that hold an object beyond that of the closed fingers [m]."""
OPENING_STEP = 0.004
"""Increase of the opening after each failed attempt, because the object may lie beside its place [m]."""
TOLERATED_YAW_ERROR = 3.0
"""Error of the yaw of an object for which the opening leaves space, in standard deviations."""


class FingerModel(Section):
    """Model of a gripper whose fingers move by coupled joints, in a URDF with `<mimic>`."""

    urdf: str
    """Path of the URDF, relative to the cell file or `package:NAME/...`, as of an arm."""
    rotation_deg: Angles = (0.0, 0.0, 0.0)
    """Rotation of the model on the flange: roll, pitch, yaw [degree]. The fingers then close along y."""
    joint: str
    """Name of the joint with the motor."""
    openings: tuple[tuple[float, float], ...] = Field(min_length=2)
    """Positions of this joint [rad or m], each with the distance between the pads [m]."""
    effort: Force
    """Torque [Nm] or force [N] of the motor with which each finger presses with `force`."""


class Fingers(ToolModel):
    """A gripper with two parallel fingers, which hold an object by friction.

    The tool centre point lies between the pads. The fingers close along the y axis of the tool. The distance
    between the closed fingers is evidence about the class of the object.
    """

    noun: ClassVar[str] = "grip"
    needs_yaw: ClassVar[bool] = True

    kind: Literal["fingers"] = "fingers"
    stroke: Length
    """Distance between the open fingers [m]."""
    closed: Distance = 0.0
    """Distance between the closed fingers [m]."""
    finger: tuple[Length, Length, Length]
    """Size of a finger [m]: along the pad (x), along the motion of the fingers (y), and from palm to tip."""
    root: tuple[Distance, Length] | None = None
    """Distance from the tool centre point up to the thicker upper part of a finger, and its size along the
    motion of the fingers [m]. If not given, all of the finger has the same size."""
    tip: Length = 0.01
    """Distance of the tips beyond the tool centre point [m]."""
    depth: Distance = 0.0
    """Distance from the tool centre point up to links that are nearer to the axis than the pads [m], for
    objects with a flat top; 0: there are no such links below the palm."""
    palm: tuple[Length, Length]
    """Side lengths of the palm along x and y [m]; the palm reaches up to the flange."""
    force: Force
    """Force of each finger on the object [N]."""
    speed: float = Field(0.1, ge=0.01, le=1)
    """Speed of each finger [m/s]."""
    friction: float = Field(1.0, ge=0.05, le=5)
    """Coefficient of friction of the pads; that of a contact is the product with `friction` of the object."""
    model: FingerModel | None = None
    """URDF of the gripper; by default, its links are boxes of the declared sizes. The sizes remain those with
    which motions are planned, so they enclose the links of the model."""
    allowance: Length = 0.006
    """Distance of each open finger from the object before the grasp [m]."""
    release_allowance: Length = 0.003
    """Distance of each open finger from the object after the release [m]."""
    descent_speed: float = Field(0.25, ge=0.001, le=0.25)
    """Tool speed while the open fingers move down beside an object [m/s]."""
    width_tolerance: Length = 0.004
    """Maximum difference between the distance of the fingers at a grip and the declared width of a class [m],
    unless the class declares `grip_widths`. In 2,900 grips of cubes, spheres and ducks, 99 % were within
    4 mm; a duck that had been taken for a cube was 4.5 mm too wide."""

    @model_validator(mode="after")
    def _check_sizes(self) -> Fingers:
        if self.closed >= self.stroke:
            raise ValueError(f"needs a stroke above the distance of the closed fingers, {self.closed:g} m")
        if self.finger[2] - self.tip >= self.length:
            raise ValueError(f"needs fingers that are shorter than its length, {self.length:g} m")
        openings = [opening for _, opening in sorted(self.opening_table)]
        if openings not in (sorted(openings), sorted(openings, reverse=True)):
            raise ValueError(
                "needs model.openings that only grow or only fall with the position of the joint"
            )
        if (min(openings), max(openings)) != (self.closed, self.stroke):
            raise ValueError(
                f"needs model.openings from {self.closed:g} m, as closed, to {self.stroke:g} m, as stroke"
            )
        if self.palm_offset <= (self.root[0] if self.root else 0.0):
            raise ValueError("needs fingers that are longer than their tips below the root")
        return self

    def replace_paths(self, resolve: Callable[..., str]) -> Self:
        """Return this section with the absolute path of the model."""
        if self.model is None:
            return self
        model = self.model.model_copy(update={"urdf": resolve(self.model.urdf, "model", "urdf")})
        return self.model_copy(update={"model": model})

    @property
    def max_opening(self) -> float:
        """Distance between the open fingers [m]."""
        return self.stroke

    @property
    def min_opening(self) -> float:
        """Distance between the closed fingers [m]."""
        return self.closed

    @property
    def palm_offset(self) -> float:
        """Distance from the tool centre point back to the palm [m]."""
        return self.finger[2] - self.tip

    @property
    def parts(self) -> tuple[ToolPart, ...]:
        """The palm; none with a model, which has its own shapes."""
        return () if self.model else (self.list_parts(self.stroke)[0],)

    def list_parts(self, opening: float) -> Sequence[ToolPart]:
        """Return palm and fingers; the fingers are fully open at the opening 0."""
        parts = [ToolPart.make_box(self.palm_offset, self.length - self.palm_offset, self.palm)]
        for offset, length, thickness in self._finger_boxes:
            sides = (self.finger[0], thickness)
            place = ((opening or self.stroke) + thickness) / 2
            parts.extend(ToolPart.make_box(offset, length, sides, (0.0, sign * place)) for sign in (1, -1))
        return parts

    @property
    def _finger_boxes(self) -> list[tuple[float, float, float]]:
        """Offset, length and thickness of the boxes of a finger [m], the upper one first."""
        if self.root is None:
            return [(-self.tip, self.finger[2], self.finger[1])]
        height, thickness = self.root
        return [
            (height, self.palm_offset - height, thickness),
            (-self.tip, self.tip + height, self.finger[1]),
        ]

    def build_links(self) -> str:
        """Return the links and joints of the model, or boxes with prismatic joints."""
        if self.model is not None:
            # The module loads PyBullet in 0.3 s, and only a simulation or a check needs the links.
            from executive.physics.arm_model import build_attached_links

            return build_attached_links(self.model.urdf, self.model.rotation_deg)
        template = Template(Path(__file__).with_name("finger.urdf").read_text(encoding="utf-8"))
        values = {
            "tool_length": self.length,
            "max_position": self.stroke / 2,
            "speed": self.speed,
            "force": self.force,
        }
        links = []
        for name, sign in zip(FINGER_JOINTS, (1, -1), strict=True):
            shapes = "".join(
                f'<{shape}><origin xyz="0 {sign * thickness / 2} {-offset - length / 2}"/><geometry>'
                f'<box size="{self.finger[0]} {thickness} {length}"/></geometry></{shape}>'
                for offset, length, thickness in self._finger_boxes
                for shape in ("visual", "collision")
            )
            links.append(template.substitute(values, name=name, sign=sign, shapes=shapes))
        return "".join(links)

    def compute_joint_positions(self, opening: float) -> Mapping[str, float]:
        """Return the positions at an opening [m]; at the opening 0, the fingers are fully open."""
        table = np.array(sorted((opening, position) for position, opening in self.opening_table))
        position = float(np.interp(opening or self.stroke, table[:, 0], table[:, 1]))
        return {name: factor * position for name, factor in self.couplings.items()}

    @property
    def opening_table(self) -> tuple[tuple[float, float], ...]:
        """Positions of the first joint of `couplings`, each with the distance between the fingers [m]."""
        if self.model is not None:
            return self.model.openings
        return ((self.stroke / 2, self.stroke), (self.closed / 2, self.closed))

    @property
    def effort(self) -> float:
        """Maximum force [N] or torque [Nm] of the motor of each joint."""
        return self.model.effort if self.model else self.force

    @property
    def couplings(self) -> Mapping[str, float]:
        """Ratio of the position of each joint of the fingers to that of the first one, by name."""
        if self.model is None:
            return dict.fromkeys(FINGER_JOINTS, 1.0)
        return read_couplings(self.model.urdf, self.model.joint)

    @property
    def max_holding_force(self) -> float:
        """Sum of the forces of both fingers [N]."""
        return 2 * self.force

    def compute_holding_force(self, object_class: ObjectClass, force: float) -> float:
        """Return the friction of both fingers on an object [N], by Coulomb's law.

        Above or below the centre of mass, the pads also resist a moment. The lever of their friction is two
        thirds of the radius of a circle with the area of a pad, as for a disc under constant pressure.
        """
        pad_radius = math.sqrt(self.finger[0] * 2 * self.tip / math.pi)
        distance = abs(self.get_hold_height(object_class) - object_class.height / 2)
        lever_ratio = 2 / 3 * pad_radius / distance if distance else 1.0
        return force * self.friction * object_class.friction * min(lever_ratio, 1.0)

    def explain_unsuitable(self, object_class: ObjectClass) -> str:
        """Return a clause about an object that is too wide or too low, or that slips out of the fingers."""
        label = object_class.label
        width = min(width for width, _ in self._list_widths(object_class))
        if width + 2 * MIN_ALLOWANCE > self.stroke:
            needed = f"{(width + 2 * MIN_ALLOWANCE) * 1000:.0f} mm"
            return f"a {label} needs an opening of {needed}, and the fingers open {self.stroke * 1000:.0f} mm"
        low, high = max(self._list_grip_ranges(object_class))
        if high <= self.closed + MIN_GRIP_WIDTH or low > self.stroke:
            closed = f"the fingers hold {self.closed * 1000:.0f} to {self.stroke * 1000:.0f} mm"
            return f"a {label} is {low * 1000:.0f} to {high * 1000:.0f} mm wide in the fingers, and {closed}"
        tip_height = self.get_hold_height(object_class) - self.tip
        if object_class.height < tip_height + MIN_OVERLAP:
            height = f"a {label} is {object_class.height * 1000:.0f} mm high"
            return f"{height}, too low for tips {tip_height * 1000:.0f} mm above its underside"
        return ""

    def get_hold_height(self, object_class: ObjectClass) -> float:
        """Return the height of the pads above the underside of an object [m]: the middle, if possible."""
        depth = self.palm_offset - PALM_CLEARANCE
        if self.depth and object_class.flat_top:
            depth = self.depth
        lowest = max(self.tip + MIN_TIP_HEIGHT, object_class.height - depth)
        height = object_class.grip_height or object_class.height / 2
        if object_class.grasp_points:
            height = object_class.hold_height
        return max(height, lowest)

    def compute_release_opening(self, object_class: ObjectClass) -> float:
        """Return the width of an object, and the allowance of a release on both sides [m]."""
        width = max(width for width, _ in self._list_widths(object_class))
        return min(width + 2 * self.release_allowance, self.stroke)

    def list_grasps(
        self, object_class: ObjectClass, target: Target, motion: MotionConfig, attempt: GraspAttempt
    ) -> list[GraspPose]:
        """Return a grasp of each pair of opposite sides, the narrowest first.

        The open fingers move down on both sides of the object; a contact on the way is a failure. If the
        angle of an object is unknown, its circle around the outline counts.
        """
        z = float(target.pose_at(target.stamp).position[2])
        # A wrong depth image shows objects below the table, on which they cannot lie.
        bottom = max(z - object_class.height / 2, 0.0)
        end_height = bottom + self.get_hold_height(object_class)
        clearance = max(motion.descent, motion.margin + TIP_CLEARANCE)
        start_height = bottom + object_class.height + self.tip + clearance
        yaw = target.yaw
        if not yaw and 2 * object_class.radius + 2 * MIN_ALLOWANCE > self.stroke:
            cause = "fits between the fingers only at a known yaw, which no image showed"
            raise Blocked(f"{target.item} {cause}")
        grasps = []
        is_round = not object_class.yaw_symmetry
        widths = self._list_widths(object_class) if yaw or is_round else [(2 * object_class.radius, ())]
        places = self.list_points(object_class, target)
        # Each grasp point has a width of its own; without grasp points, the middle has several.
        has_points = bool(object_class.grasp_points)
        pairs = [*zip(places if has_points else places * len(widths), itertools.cycle(widths), strict=False)]
        # Another attempt begins with another point, or with the other end of an object whose ends look alike.
        first = attempt.number % len(places)
        for (x, y, _), (width, directions) in pairs[first:] + pairs[:first]:
            opening = width + 2 * self.allowance + attempt.number * OPENING_STEP
            yaws: tuple[float, ...] = ()
            if yaw and directions:
                # A turned object is wider by the length of its sides times the sine of the angle.
                opening += 2 * object_class.radius * math.sin(min(TOLERATED_YAW_ERROR * yaw.std, math.pi / 4))
                yaws = tuple(yaw.angle + direction for direction in directions)
            goal = Goal(
                (float(x), float(y), end_height),
                yaws,
                guarded_length=start_height - end_height,
                guarded_speed=self.descent_speed,
            )
            opening = min(opening, self.stroke)
            grasps.append(GraspPose(goal, end_height, guard="clear", opening=opening))
        return grasps

    def compute_held_yaw(self, object_class: ObjectClass, yaw: Yaw, tool_yaw: float) -> Yaw:
        """Return the yaw of an object whose sides the fingers have turned parallel to the pads."""
        held_yaw = super().compute_held_yaw(object_class, yaw, tool_yaw)
        if points := object_class.grasp_points:
            turns = [
                math.remainder(math.pi / 2 - point.direction - held_yaw.angle, math.pi) for point in points
            ]
            return held_yaw._replace(angle=held_yaw.angle + min(turns, key=abs))
        # Sides of the object and directions of the fingers are equal after these rotations.
        step = math.tau / math.lcm(4, yaw.symmetry)
        return held_yaw._replace(angle=round(held_yaw.angle / step) * step)

    def compute_grip_opening(self, object_class: ObjectClass) -> float:
        """Return the middle of the largest range of distances of the fingers at a grip [m]."""
        return sum(max(self._list_grip_ranges(object_class))) / 2

    def measure_grip(self, object_class: ObjectClass, opening: float) -> ToolMeasurement:
        """Return a contradiction if the distance of the fingers is that of no grasp of the class.

        Closed fingers have missed the object.
        """
        if opening <= self.closed + MIN_GRIP_WIDTH:
            return ToolMeasurement(is_miss=True)
        ranges = self._list_grip_ranges(object_class)
        if any(low <= opening <= high for low, high in ranges):
            return ToolMeasurement()
        expected = " or ".join(f"{low * 1000:.0f} to {high * 1000:.0f} mm" for low, high in ranges)
        message = f"the fingers hold it {opening * 1000:.0f} mm apart, and a {object_class.label} {expected}"
        return ToolMeasurement(message)

    def find_distinct_labels(self, classes: Mapping[str, ObjectClass]) -> Collection[str]:
        """Return the classes whose widths at a grip overlap with those of no other class."""
        ranges = {label: self._list_grip_ranges(object_class) for label, object_class in classes.items()}
        overlapping_labels = {
            label
            for label, other in itertools.permutations(classes, 2)
            for (low, high), (other_low, other_high) in itertools.product(ranges[label], ranges[other])
            if low <= other_high and other_low <= high
        }
        return classes.keys() - overlapping_labels

    def _list_widths(self, object_class: ObjectClass) -> list[tuple[float, tuple[float, ...]]]:
        """Return the widths of an object between the fingers [m], with the yaws of the tool relative to it.

        The yaws [rad] of a round object are (): every yaw is permitted.
        """
        footprint = object_class.footprint
        if points := object_class.grasp_points:
            length, width = footprint or (2 * object_class.radius, 2 * object_class.radius)
            return [
                (
                    point.width or (width if abs(math.sin(point.direction)) > math.sqrt(0.5) else length),
                    (point.direction - math.pi / 2, point.direction + math.pi / 2)
                    if object_class.yaw_symmetry
                    else (),
                )
                for point in points
            ]
        if footprint is None or not object_class.yaw_symmetry:
            return [(2 * object_class.radius, ())]
        length, width = footprint
        symmetry = object_class.yaw_symmetry
        # The fingers close along y; both directions of the tool are equal.
        across = (0.0, math.pi)
        along = (math.pi / 2, -math.pi / 2)
        if symmetry > 2:
            narrow_side = across[0] if width <= length else along[0]
            yaws = tuple(narrow_side + math.tau * index / symmetry for index in range(symmetry))
            return [(min(footprint), yaws)]
        pairs: list[tuple[float, tuple[float, ...]]] = sorted([(width, across), (length, along)])
        return [pair for pair in pairs if pair[0] + 2 * MIN_ALLOWANCE <= self.stroke] or pairs[:1]

    def _list_grip_ranges(self, object_class: ObjectClass) -> list[tuple[float, float]]:
        """Return the smallest and largest distances of the fingers at a grip of an object [m]."""
        if object_class.grip_widths:
            return [object_class.grip_widths]
        tolerance = self.width_tolerance
        return [(width - tolerance, width + tolerance) for width, _ in self._list_widths(object_class)]

    def build_sim(self, world: World, noise_seed: int = 0) -> SimFingers:
        """Return the simulated fingers, which hold an object by the friction of the physics engine."""
        # The module loads PyBullet in 0.3 s; a cell without physics needs no simulated tool.
        from executive.drivers.sim.fingers import SimFingers

        return SimFingers(world, self, noise_seed)


@lru_cache(maxsize=16)
def read_couplings(urdf: str, joint: str) -> Mapping[str, float]:
    """Return the ratio of the position of each coupled joint of a tool to that of `joint`, which is first.

    The names are those of the model attached to an arm, with the prefix `ATTACHED_PREFIX`.

    Raises:
        InputError: The model has no such joint, or a coupled joint has no limits, or an offset.
    """
    path = find_model(urdf)
    joints = read_robot(path).findall("joint")
    names = [element.get("name", "") for element in joints]
    if joint not in names:
        raise InputError(
            f'the model {path.name} has no joint "{joint}"; {suggest_choice(joint, names, "Joints")}'
        )
    factors = {joint: 1.0}
    for element in joints:
        mimic = element.find("mimic")
        if mimic is not None and mimic.get("joint") == joint:
            (factors[element.get("name", "")],) = parse_numbers(path, mimic, "multiplier", (1.0,))
    for element in joints:
        name = element.get("name", "")
        has_limits = element.get("type") in ("revolute", "prismatic") and element.find("limit") is not None
        has_offset = any(parse_numbers(path, each, "offset", (0.0,))[0] for each in element.iter("mimic"))
        if name in factors and (has_offset or not has_limits):
            needed = "revolute or prismatic, with a <limit>, and its <mimic> without an offset"
            raise InputError(f'the joint "{name}" of {path.name} must be {needed}')
    return {ATTACHED_PREFIX + name: factor for name, factor in factors.items()}
