"""Objects of a cell: classes, items, targets, loads, obstacles, and the bins that receive them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple, TypeAlias

import numpy as np

from executive.geometry import Array, Pose, Yaw, rotate_about_z

UNKNOWN_LABEL = "unknown"
"""Label of an object without a class."""
Item = str
"""Id of one physical object in the ledger, for instance `cube-2`."""


@dataclass(frozen=True)
class RefersTo:
    """Marker in the type of a field: the field contains the name of an `item`, a `class` or a `bin`."""

    kind: str


ItemName = Annotated[Item, RefersTo("item")]
ClassName = Annotated[str, RefersTo("class")]
BinName = Annotated[str, RefersTo("bin")]


@dataclass(frozen=True, eq=False)
class Target:
    """An item on the table that a skill may pick.

    Attributes:
        item: Id of the item.
        label: Class name.
        position: Centre of the object `(3,)` [m] at `stamp`, at half the height of its class.
        confidence: Confidence of the last detection, 0 to 1.
        frame: Id of the last frame that showed the item.
        change_count: Number of robot actions that may have moved objects before the capture of that frame.
        stamp: Capture time of the last frame that showed the item [s].
        yaw: Angle of the object in the world at `stamp`; None if it is unknown.
    """

    item: ItemName
    label: ClassName
    position: Array
    confidence: float
    frame: int
    change_count: int
    stamp: float
    yaw: Yaw | None = None
    omits_none: ClassVar[bool] = True

    def __post_init__(self) -> None:
        # The ledger keeps the same array, which no skill may change.
        self.position.flags.writeable = False

    def pose_at(self, time: float) -> Pose:  # noqa: ARG002
        """Return the pose of the object at a time [s], without a rotation if its yaw is unknown.

        The frame of the pose is that of the surface on which the object lies: the table, whose frame is the
        world, and on which an object rests.
        """
        return Pose(rotate_about_z(self.yaw.angle if self.yaw else 0.0), self.position)


@dataclass(frozen=True, eq=False)
class KnownItem:
    """Present knowledge of the ledger about an item; a mission reads the fields as `$item.attempts`.

    Attributes:
        item: Id of the item.
        label: Name of the most probable class.
        state: `open`: still to be sorted; `deferred`: open, behind the other items; `held`; `placed`;
            `rejected`; `skipped`: without a route or beyond a quota; `lost`: dropped and not found since.
        bin: Name of the bin that contains the item, or "".
        position: Last known position of the centre `(3,)` [m] in the world.
        attempts: Number of failed attempts to pick the item, or another item at its position.
        drops: Number of times that the tool dropped the item.
        deferrals: Number of times that the item was deferred.
        deferral_rank: Rank among the deferred items, in the order of deferral; 0 if the item is not deferred.
    """

    item: ItemName
    label: ClassName
    state: str
    bin: BinName
    position: Array
    attempts: int
    drops: int
    deferrals: int
    deferral_rank: int

    def __post_init__(self) -> None:
        # The ledger keeps the same array, which no skill may change.
        self.position.flags.writeable = False

    @property
    def is_open(self) -> bool:
        """True if the item still has to be sorted and is not lost."""
        return self.state in ("open", "deferred")


class GraspPoint(NamedTuple):
    """A point of an object at which a tool holds it.

    Attributes:
        position: x and y from the middle of the object, and z above its underside [m]; the axes are those of
            the model after `upright_deg`.
        width: Distance between fingers that hold the object there [m].
        direction: Angle of the line on which the fingers close [rad], from the x axis of the object.
    """

    position: tuple[float, float, float]
    width: float | None = None
    direction: float = math.pi / 2


@dataclass(frozen=True)
class ObjectClass:
    """Known properties of a class of objects.

    Attributes:
        label: Class name that the detectors use.
        height: Height of the object as it lies on the table [m].
        radius: Radius of the circle around the outline of the object, seen from above [m].
        contact_radius: Largest distance of a contact point from the centre [m]; above 0 only for parts with a
            hole and for grasp points beside the centre.
        mass: Mass of the object [kg].
        mass_std: Standard deviation of the mass between the objects of the class [kg]; infinite if the cell
            file declares no mass.
        looks_like: Class whose label the detectors report for objects of this class; "": this class.
        footprint: Length and width of the rectangle around the outline, seen from above [m]; None: unknown.
        flat_top: True if every point of the top has the height of the class.
        yaw_symmetry: Number of equal rotations per revolution after which the object, seen from above, looks
            the same: 4 for a cube, 1 without symmetry, 0 for a round object, which has no yaw.
        yaw_offset: Angle in the frame of the object [rad] of the part of its outline whose direction an image
            shows: of a corner; for a symmetry of 2 of the longer axis, and of 1 of its narrower end.
        support_heights: Heights above the table of the surfaces on which an object of the class may lie [m].
        friction: Coefficient of friction of the surface.
        grip_height: Height above the underside at which fingers hold the object [m]; 0: the middle.
        grip_widths: Smallest and largest distance between the fingers that hold the object [m]; None: that
            of the sides of `footprint`, or the diameter of a round object.
        grasp_points: Points at which tools hold the object, the best first; (): the middle.
    """

    label: str
    height: float
    radius: float
    contact_radius: float = 0.0
    mass: float = 0.1
    mass_std: float = math.inf
    looks_like: str = ""
    footprint: tuple[float, float] | None = None
    flat_top: bool = False
    yaw_symmetry: int = 0
    yaw_offset: float = 0.0
    support_heights: tuple[float, ...] = (0.0,)
    friction: float = 0.5
    grip_height: float = 0.0
    grip_widths: tuple[float, float] | None = None
    grasp_points: tuple[GraspPoint, ...] = ()

    @property
    def top_heights(self) -> list[float]:
        """Possible heights above the table of the top of an object of the class [m], ascending."""
        return sorted({self.height + support_height for support_height in self.support_heights})

    @property
    def hold_height(self) -> float:
        """Height above the underside of a touch from above [m], which all grasp points have."""
        return max((point.position[2] for point in self.grasp_points), default=self.height)

    @property
    def touch_heights(self) -> list[float]:
        """Possible heights above the table of a touch from above [m]."""
        return [self.hold_height + support_height for support_height in self.support_heights]

    @property
    def outline_area(self) -> float:
        """Area of the outline, seen from above [m²]; an upper limit, if the footprint is known."""
        circle_area = math.pi * self.radius**2
        return circle_area if self.footprint is None else min(circle_area, math.prod(self.footprint))

    @property
    def detected_label(self) -> str:
        """Class whose label the detectors report for objects of this class."""
        return self.looks_like or self.label


@dataclass(frozen=True)
class Obstacle:
    """An upright cylinder on the table that the arm must avoid.

    Attributes:
        x, y: Position of the axis in the world [m].
        radius: Radius of the cylinder [m].
        top: Height of the upper end in the world [m].
        name: Name of the obstacle in error messages.
    """

    x: float
    y: float
    radius: float
    top: float
    name: str


BIN_THICKNESS = 0.005
"""Thickness of a bin's floor and walls [m]."""


@dataclass(frozen=True, eq=False)
class Bin:
    """A container into which objects are sorted.

    Attributes:
        name: Name in the cell file.
        position: Centre of the underside of the floor in the world `(3,)` [m].
        size: Inner length, width and wall height `(3,)` [m].
        slots: Drop positions over the floor `(N, 2)` [m], in the order of their use.
        colour: Red, green and blue of the walls, each 0 to 1.
        place_yaws: Angle of the object in each slot [rad], see `BinConfig.place_yaw_deg`; (): every angle is
            permitted.
    """

    name: str
    position: Array
    size: Array
    slots: Array
    colour: tuple[float, float, float] = (0.6, 0.6, 0.6)
    place_yaws: tuple[float, ...] = ()

    @cached_property
    def walls(self) -> Sequence[tuple[Array, Array]]:
        """Smallest and largest corner of the base of each of the four walls, `(2,)` each [m]."""
        low = self.position[:2] - self.size[:2] / 2
        high = self.position[:2] + self.size[:2] / 2
        outer_low = low - BIN_THICKNESS
        outer_high = high + BIN_THICKNESS
        return [
            (outer_low, np.array([low[0], outer_high[1]])),
            (np.array([high[0], outer_low[1]]), outer_high),
            (np.array([low[0], outer_low[1]]), np.array([high[0], low[1]])),
            (np.array([low[0], high[1]]), np.array([high[0], outer_high[1]])),
        ]

    def contains(self, position: Array, margin: float = 0.0) -> bool:
        """Return True if x and y of `position` `(3,)` [m] are in the floor area, enlarged by `margin` [m]."""
        return bool(np.all(np.abs(position[:2] - self.position[:2]) <= self.size[:2] / 2 + margin))


Quotas: TypeAlias = Mapping[tuple[str, str | None], int]
"""Maximum number of objects by bin and class; the class None stands for the objects of all classes."""


def is_quota_reached(
    quotas: Quotas, bin: str, label: str, count_objects: Callable[[str, str | None], int]
) -> bool:
    """Return True if a bin takes no further object of the class `label`.

    `count_objects` returns the number of objects of a class in a bin; of all classes if the class is None.
    """
    limits = ((key, quotas.get((bin, key))) for key in (None, label))
    return any(limit is not None and count_objects(bin, key) >= limit for key, limit in limits)
