"""Kinds of tools: what depends on the tool of a cell, from collision parts over grasps to wording."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from executive.cell.arm import Goal
from executive.cell.device_config import Length, MotionConfig, Section
from executive.cell.objects import ObjectClass, Target
from executive.errors import Blocked, InputError
from executive.geometry import Array, Pose, Yaw, rotate_about_z
from executive.plugins import list_entries

TOOL_GROUP = "executive.tools"
"""Entry-point group of kinds of tools."""
DEFAULT_KIND = "suction"
"""Kind of a tool section without the key `kind`, as in all cell files before there were several kinds."""

OVERTRAVEL = 0.015
"""Default distance by which a guarded motion continues below the expected surface of an object [m]."""
CONTACT_SPACING = 0.0025
"""Default distance between the contact points of repeated attempts [m]."""


@dataclass(frozen=True)
class ToolPart:
    """An upright cylinder about the axis of the tool, or an upright box, for collision checks and displays.

    Attributes:
        offset: Distance from the tool centre point back to the lower end of the part [m].
        length: Length along the axis [m].
        radius: Radius of the smallest cylinder about the axis that contains the part [m].
        sides: Side lengths of a box along x and y of the tool [m]; None: the part is a cylinder.
        centre: Centre of a box, x and y relative to the axis of the tool [m].
    """

    offset: float
    length: float
    radius: float
    sides: tuple[float, float] | None = None
    centre: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def make_box(
        offset: float, length: float, sides: tuple[float, float], centre: tuple[float, float] = (0.0, 0.0)
    ) -> ToolPart:
        """Return a part that is a box; the arguments are as the attributes."""
        corner = [abs(place) + side / 2 for place, side in zip(centre, sides, strict=True)]
        return ToolPart(offset, length, math.hypot(*corner), sides, centre)

    def list_corners(self) -> Array:
        """Return the corners `(8, 3)` of a box in the frame of the tool [m]; of a cylinder, none."""
        if self.sides is None:
            return np.zeros((0, 3))
        ranges = [
            (place - side / 2, place + side / 2) for place, side in zip(self.centre, self.sides, strict=True)
        ]
        return np.array(list(itertools.product(*ranges, (-self.offset - self.length, -self.offset))))


@dataclass(frozen=True)
class GraspPose:
    """An approach after which the tool can grip an object.

    Attributes:
        goal: End of the approach: its position, its permitted yaws, and its guarded part.
        contact_height: Height at which the tool should touch the object [m].
        proves_absence: True if no object is at the target when the tool touches nothing on the way.
        guard: `touch`: the tool stops at a contact, without which the approach fails; `clear`: a contact is
            a failure.
        opening: Distance between the fingers before the grasp [m]; 0 for a tool without fingers.
    """

    goal: Goal
    contact_height: float
    proves_absence: bool = False
    guard: Literal["touch", "clear"] = "touch"
    opening: float = 0.0


@dataclass(frozen=True)
class ToolMeasurement:
    """Evidence about the class of an object that the tool measured at its contact with the object.

    Attributes:
        contradiction: Sentence that states how the measured value contradicts the class, or "".
        may_be_wrong: True if the tool may have measured at another place of the object than intended.
        is_miss: True if the tool cannot grip the object there.
    """

    contradiction: str = ""
    may_be_wrong: bool = False
    is_miss: bool = False


class GraspAttempt(NamedTuple):
    """One of several attempts to grasp an object.

    Attributes:
        number: Number of failed attempts before this one.
        is_confirmed: True if a measurement of the tool has confirmed the properties of the class.
        overtravel: Distance by which a guarded motion continues below the expected surface [m].
        spacing: Distance between the contact points of repeated attempts [m].
    """

    number: int = 0
    is_confirmed: bool = False
    overtravel: float = OVERTRAVEL
    spacing: float = CONTACT_SPACING


class ToolModel(Section):
    """Section of a cell file about its tool, and everything that depends on the kind of tool.

    Each entry point of the group `executive.tools` is a subclass; its fields are keys of the section `tool`.
    Distances are along the axis of the tool, which points down at a grasp.

    Attributes:
        noun: Noun for the hold of the tool on an object in messages, for instance `grip`.
        tip_length: Length of the end of the tool that may touch an object in a guarded motion [m].
        touch_distance: Maximum distance from a surface at which the tool senses the surface [m].
        safety_factor: Ratio of the holding force to the largest force on the grip during a motion.
        min_lift_acceleration: Lower limit of the maximum acceleration of a lift, even if the tool holds with
            less force [m/s²].
        needs_yaw: True if a grasp depends on the yaw of the object, so that images must show it.
    """

    noun: ClassVar[str] = "grip"
    tip_length: ClassVar[float] = 0.002
    touch_distance: ClassVar[float] = 0.001
    safety_factor: ClassVar[float] = 2.0
    min_lift_acceleration: ClassVar[float] = 0.5
    needs_yaw: ClassVar[bool] = False

    kind: str = DEFAULT_KIND
    """Kind of tool: the name of an entry point of the group `executive.tools`."""
    length: Length = 0.12
    """Distance from the flange to the tool centre point [m]."""
    load_std: float = Field(0.05, gt=0, le=100)
    """Standard deviation of a reading of the load [N]. The default is assumed: 0.5 % of 10 N, the range of a
    small load cell."""
    source: str
    """Source of the constants."""

    @classmethod
    def select_class(cls, section: Mapping[str, object]) -> type[ToolModel]:
        """Return the class of the kind that a section names.

        Raises:
            ValueError: The kind is not installed, or its class cannot be loaded.
        """
        kind = str(section.get("kind", DEFAULT_KIND))
        entries = list_entries(TOOL_GROUP, "kind of tool")
        if kind not in entries:
            raise ValueError(f'has no installed kind "{kind}"; installed: {", ".join(entries) or "none"}')
        try:
            model: type[ToolModel] = entries[kind].load()
        except InputError as error:
            raise ValueError(str(error)) from error
        if not (isinstance(model, type) and issubclass(model, ToolModel)):
            raise ValueError(f"{entries[kind].value} is no subclass of executive.cell.tools.ToolModel")
        return model

    @model_validator(mode="wrap")
    @classmethod
    def _parse_as_kind(cls, section: Any, parse: Callable[[Any], ToolModel]) -> ToolModel:
        """Parse a section whose declared type is this base class as an instance of the class of its kind."""
        if cls is ToolModel and isinstance(section, dict):
            return cls.select_class(section).model_validate(section, strict=True)
        return parse(_convert_to_tuples(section))

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema of a kind of tool; for this base class, of all installed kinds."""
        if cls is not ToolModel:
            return handler(schema)
        kinds = [handler(model.__pydantic_core_schema__) for model in load_tool_models().values()]
        return kinds[0] if len(kinds) == 1 else {"anyOf": kinds}

    def replace_paths(self, _resolve: Callable[..., str]) -> Self:
        """Return this section with absolute paths, each made of a path and its keys in this section."""
        return self

    @property
    def parts(self) -> Sequence[ToolPart]:
        """Parts of the tool, from the flange to the tip."""
        raise NotImplementedError(f"{type(self).__name__} does not define `parts`")

    @property
    def max_opening(self) -> float:
        """Largest distance between the fingers [m]; 0 for a tool without fingers."""
        return 0.0

    @property
    def min_opening(self) -> float:
        """Distance between the closed fingers [m]."""
        return 0.0

    def list_parts(self, opening: float) -> Sequence[ToolPart]:  # noqa: ARG002
        """Return `parts`, and the fingers at an opening [m], the lowest last and the palm first."""
        return self.parts

    def build_links(self) -> str:
        """Return links and joints of a URDF that hang on the link `tool`; "" for a tool of one rigid part."""
        return ""

    def compute_joint_positions(self, opening: float) -> Mapping[str, float]:  # noqa: ARG002
        """Return the positions of the joints of `build_links` by name at an opening [m]."""
        return {}

    @property
    def max_holding_force(self) -> float:
        """Largest force with which the tool can hold an object [N]."""
        raise NotImplementedError(f"{type(self).__name__} does not define `max_holding_force`")

    def explain_unsuitable(self, object_class: ObjectClass) -> str:  # noqa: ARG002
        """Return a clause that states why the tool cannot hold objects of a class, or ""."""
        return ""

    def get_hold_height(self, object_class: ObjectClass) -> float:
        """Return the distance from the tool centre point down to the underside of a held object [m]."""
        return object_class.hold_height

    def compute_holding_force(self, object_class: ObjectClass, force: float) -> float:  # noqa: ARG002
        """Return the maximum force on an object of a class [N] if the sensor of the tool reports `force`."""
        return force

    def measure_hold(self, client: Any, X_WT: Pose, body: int) -> float:  # noqa: ARG002
        """Return the force with which the surface of a body of a pybullet client can be held [N]."""
        return math.inf

    def compute_release_opening(self, object_class: ObjectClass) -> float:  # noqa: ARG002
        """Return the distance between the fingers after the release of an object [m]."""
        return 0.0

    def list_points(self, object_class: ObjectClass, target: Target) -> list[Array]:
        """Return the places of the grasp points of an object in the world `(3,)` [m], the best first.

        If an image did not show which of its ends is which, each point is at two places.

        Raises:
            Blocked: The points depend on the yaw of the object, which no image showed.
        """
        X_WO = target.pose_at(target.stamp)
        to_top = np.array([0.0, 0.0, object_class.height / 2])
        if not object_class.grasp_points:
            return [X_WO.position + to_top]
        if target.yaw is None and object_class.contact_radius:
            raise Blocked(f"{target.item} can be held only at a known yaw, which no image showed")
        turn_count = 1
        if target.yaw and object_class.yaw_symmetry:
            turn_count = target.yaw.symmetry // object_class.yaw_symmetry
        turns = [rotate_about_z(math.tau * index / turn_count) for index in range(turn_count)]
        return [
            X_WO.position - to_top + X_WO.rotation @ turn @ point.position
            for turn in turns
            for point in object_class.grasp_points
        ]

    def list_grasps(
        self, object_class: ObjectClass, target: Target, motion: MotionConfig, attempt: GraspAttempt
    ) -> Sequence[GraspPose]:
        """Return the possible grasps of an object, at least one, the best first.

        Args:
            object_class: Class of the object.
            target: Place of the object, and its yaw if it is known.
            motion: Heights and speed of guarded motions.
            attempt: The attempt, which may have another grasp than the attempts before.

        Raises:
            Blocked: The tool needs the yaw of the object, which is unknown.
        """
        raise NotImplementedError(f"{type(self).__name__} does not define `list_grasps`")

    def compute_held_yaw(self, object_class: ObjectClass, yaw: Yaw, tool_yaw: float) -> Yaw:  # noqa: ARG002
        """Return the yaw of a held object relative to the tool; the default is that before the grasp.

        Args:
            object_class: Class of the object.
            yaw: Measured yaw of the object before the grasp.
            tool_yaw: Yaw of the tool at the grasp [rad], as in `Goal.yaws`.
        """
        return yaw._replace(angle=yaw.angle - tool_yaw)

    def measure_contact(
        self,
        object_class: ObjectClass,  # noqa: ARG002
        position: Array,  # noqa: ARG002
        height: float,  # noqa: ARG002
        classes: Mapping[str, ObjectClass],  # noqa: ARG002
        overtravel: float = OVERTRAVEL,  # noqa: ARG002
    ) -> ToolMeasurement:
        """Return the evidence of a contact with an object; the default is no evidence.

        Args:
            object_class: Assumed class of the object.
            position: Assumed centre of the object `(3,)` [m].
            height: Height of the tool centre point at the contact [m].
            classes: Classes of the cell by label.
            overtravel: As in `GraspAttempt`.
        """
        return ToolMeasurement()

    def compute_grip_opening(self, object_class: ObjectClass) -> float:  # noqa: ARG002
        """Return the expected distance between the fingers that hold an object [m]."""
        return 0.0

    def measure_grip(
        self,
        object_class: ObjectClass,  # noqa: ARG002
        opening: float,  # noqa: ARG002
    ) -> ToolMeasurement:
        """Return the evidence of the distance between the fingers that hold an object, `opening` [m]."""
        return ToolMeasurement()

    def find_distinct_labels(self, classes: Mapping[str, ObjectClass]) -> Collection[str]:  # noqa: ARG002
        """Return the classes that a measurement of the tool distinguishes from all other `classes`."""
        return ()

    def build_sim(self, world: Any, noise_seed: int = 0) -> Any:
        """Return the simulated tool of an `executive.drivers.sim.world.World`.

        The result is an `executive.drivers.sim.tool.SimTool`, or has its public attributes and methods.
        `noise_seed` is the random seed of the noise of the load.
        """
        raise NotImplementedError(f"{type(self).__name__} does not define `build_sim`")


def _convert_to_tuples(value: Any) -> Any:
    """Return a value with tuples instead of lists, which strict mode does not convert."""
    if isinstance(value, dict):
        return {key: _convert_to_tuples(entry) for key, entry in value.items()}
    return tuple(map(_convert_to_tuples, value)) if isinstance(value, list) else value


def load_tool_models() -> dict[str, type[ToolModel]]:
    """Return the class of each installed kind of tool, by its name.

    Raises:
        InputError: A class cannot be loaded.
    """
    return {name: entry.load() for name, entry in list_entries(TOOL_GROUP, "kind of tool").items()}
