"""Objects of a cell: classes, items, targets, loads and obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from executive.geometry import Array

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
        position: Centre of the object `(3,)` [m] in the world, at half the height of its class.
        confidence: Confidence of the last detection, 0 to 1.
        frame: Id of the last frame that showed the item.
        change_count: Number of robot actions that may have moved objects before the capture of that frame.
        stamp: Capture time of the last frame that showed the item [s].
    """

    item: ItemName
    label: ClassName
    position: Array
    confidence: float
    frame: int
    change_count: int
    stamp: float


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

    @property
    def is_open(self) -> bool:
        """True if the item still has to be sorted and is not lost."""
        return self.state in ("open", "deferred")


@dataclass(frozen=True)
class ObjectClass:
    """Known properties of a class of objects.

    Attributes:
        label: Class name that the detectors use.
        height: Height of the object as it lies on the table [m].
        radius: Radius of the circle around the outline of the object, seen from above [m].
        contact_radius: Distance of the contact point from the centre [m]; above 0 only for parts with a hole.
        mass: Mass of the object [kg].
        mass_std: Standard deviation of the mass between the objects of the class [kg]; infinite if the cell
            file declares no mass.
        looks_like: Class whose label the detectors report for objects of this class; "": this class.
    """

    label: str
    height: float
    radius: float
    contact_radius: float = 0.0
    mass: float = 0.1
    mass_std: float = math.inf
    looks_like: str = ""

    @property
    def detected_label(self) -> str:
        """Class whose label the detectors report for objects of this class."""
        return self.looks_like or self.label


@dataclass(frozen=True)
class Load:
    """Object in the tool.

    Attributes:
        object_class: Class of the object.
        holding_force: Maximum force that the seal of the suction cup withstands [N].
    """

    object_class: ObjectClass
    holding_force: float = math.inf


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
