"""Typed content of a cell file: objects, bins, table, ledger, detectors, and the devices.

Each field is a key of `missions/cells/*.yaml`, in SI units. Values of keys that end in `_deg` are in degrees.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    SerializeAsAny,
    ValidationInfo,
    field_validator,
    model_validator,
)

from executive.cell.arm_config import ArmConfig
from executive.cell.device_config import (
    Angle,
    Angles,
    CameraConfig,
    ClockConfig,
    Colour,
    Count,
    Distance,
    Fraction,
    Length,
    MotionConfig,
    Name,
    Natural,
    Range,
    Seconds,
    Section,
    Vector,
    check_ascending,
)
from executive.cell.frame import ErrorRates
from executive.cell.objects import Bin, GraspPoint, ObjectClass
from executive.cell.tools import ToolModel

DEFAULT_FRICTION = 0.5
"""Coefficient of friction of a class that declares none; the default of PyBullet."""
MAX_SQUARE_RATIO = 1.02
"""Maximum ratio of the sides of a footprint that counts as square."""
MAX_ROUND_RATIO = (1 + 2**0.5) / 2
"""Maximum ratio of the diameter of an object to the side of its square footprint if it counts as round."""


class GraspConfig(Section):
    """A point at which tools hold objects of a class."""

    point: Vector
    """x and y from the middle of the object, and z above its underside [m]; the axes are those of the model
    after `upright_deg`."""
    width: Length | None = None
    """Distance between fingers that hold the object there [m]; if not given, that of a side of the
    footprint."""
    direction_deg: Angle = 90.0
    """Angle from the x axis to the line on which fingers close [degree]."""


class ObjectConfig(Section):
    """A class of objects, with a URDF or a mesh as its model in simulation."""

    urdf: str = ""
    """Path of a URDF, relative to the cell file or to pybullet_data. The URDF has one link with a mass, whose
    shapes are boxes, cylinders, spheres, capsules, or meshes (`.obj`, `.stl` or `.dae`)."""
    mesh: str = ""
    """Path of a mesh (`.obj`, `.stl` or `.dae`), relative to the cell file or to pybullet_data. The collision
    shape is the convex hull of the mesh, but of each group (`o`) of an `.obj` mesh: a part with a hole needs
    several groups."""
    variants: tuple[str, ...] = ()
    """Paths of further meshes, of about the same size, for classes whose objects differ: each object in
    simulation has one of the meshes, with equal probability."""
    mass: float | None = Field(None, ge=1e-4, le=1000)
    """Mean mass of the objects [kg]. If not given, a weight is no evidence about the class, and a simulation
    uses the mass in the URDF, or 0.05 kg for a mesh."""
    mass_std: float = Field(0.002, ge=0, le=1000)
    """Standard deviation of the mass between the objects of the class [kg]."""
    looks_like: str = ""
    """Class whose label the detectors report for objects of this class, because both look alike; only the
    weight distinguishes them. If not given, the detectors report the label of this class."""
    scale: float = Field(1.0, ge=1e-4, le=1e4)
    """Scale factor of the model; a mesh at scale 1 is in metres."""
    upright_deg: Angles = (0.0, 0.0, 0.0)
    """Rotation that makes the z axis of the model point up: roll, pitch, yaw [degree]."""
    height: Length
    """Height of the object as it lies on the table [m]."""
    radius: Length
    """Radius of the circle around the outline of the object, seen from above [m]."""
    flat_top: bool = False
    """True if every point of the top has the height of the class: a lower touch then is no other point of the
    object, but another object."""
    footprint: tuple[Length, Length] | None = None
    """Length and width of the rectangle around the outline of the object, seen from above [m]. If given, both
    sides of a detected box must fit it at some yaw, otherwise only the longer side must fit the radius. If
    the top is flat, the outline in the image must be that of a prism over the part of the rectangle within
    the radius."""
    yaw_symmetry: int | None = Field(None, ge=0, le=12)
    """Number of equal rotations per revolution about the vertical axis after which the object looks the same:
    4 for a cube, 1 without symmetry, 0 for a round object, whose yaw is not measured. If not given, 0 without
    a footprint, 2 for a rectangular one, because the two ends of a part often look alike, and 4 for a square
    one; but 0 if the radius is nearer to that of the circle in the square than to that around it."""
    yaw_offset_deg: Angle | None = None
    """Angle from the x axis of the model to the part of the outline whose direction an image shows [degree]:
    to a corner; with a `yaw_symmetry` of 2 to the longer axis, and of 1 to the narrower end of that axis. If
    not given, 45 with 4, 90 with 1 or 2 and a footprint of a larger width than length, otherwise 0."""
    ring: Distance = 0.0
    """Distance of the contact point from the centre [m]; above 0 only for parts with a hole."""
    friction: float | None = Field(None, ge=0.01, le=5)
    """Coefficient of friction of the surface, for tools that hold by friction; its product with that of the
    pads counts. If not given, 0.5 is assumed, and a simulation uses the value in the URDF."""
    grip_height: Distance = 0.0
    """Height above the underside at which fingers hold the object [m]; 0: the middle."""
    grip_widths: tuple[Length, Length] | None = None
    """Smallest and largest distance between fingers that hold the object [m]; by default that of the sides of
    `footprint`, or the diameter of a round object."""
    grasp: GraspConfig | tuple[GraspConfig, ...] = ()
    """Points at which tools hold the object, the best first; by default the middle. Points beside the middle
    need images that show the yaw of the object."""
    colours: tuple[Colour, ...] = ((1.0, 1.0, 1.0),)
    """Colours (red, green, blue, each 0 to 1) from which the colour of each spawned object is drawn."""

    def list_models(self) -> list[ObjectConfig]:
        """Return this section, and copies with each of the variants as the mesh."""
        return [self, *(self.model_copy(update={"mesh": mesh}) for mesh in self.variants)]

    @property
    def grasps(self) -> tuple[GraspConfig, ...]:
        """Sections of the grasp points."""
        return self.grasp if isinstance(self.grasp, tuple) else (self.grasp,)

    @property
    def needs_yaw(self) -> bool:
        """True if a grasp point is beside the middle, so that its place depends on the yaw."""
        return any(point.point[:2] != (0.0, 0.0) for point in self.grasps)

    def draw_model(self, rng: np.random.Generator) -> ObjectConfig:
        """Return this section, or a copy with a variant as the mesh; all have the same probability."""
        return self.list_models()[int(rng.integers(1 + len(self.variants)))] if self.variants else self

    def build_class(self, label: str) -> ObjectClass:
        """Return the declared object class; if the section declares no mass, with the default mass."""
        points = tuple(
            GraspPoint(grasp.point, grasp.width, math.radians(grasp.direction_deg)) for grasp in self.grasps
        )
        distances = [math.hypot(*point.position[:2]) for point in points]
        object_class = ObjectClass(
            label, self.height, self.radius, max([self.ring, *distances]), looks_like=self.looks_like,
            footprint=self.footprint, flat_top=self.flat_top, friction=self.friction or DEFAULT_FRICTION,
            grasp_points=points,
            grip_height=self.grip_height, grip_widths=self.grip_widths, **self._derive_yaw_properties(),
        )  # fmt: skip
        if self.mass is None:
            return object_class
        return replace(object_class, mass=self.mass, mass_std=self.mass_std)

    def _derive_yaw_properties(self) -> dict[str, Any]:
        """Return symmetry and offset [rad] of the yaw, derived from the footprint if they are not given."""
        if self.footprint is None:
            return {"yaw_symmetry": 0}
        length, width = self.footprint
        is_square = max(length, width) <= MAX_SQUARE_RATIO * min(length, width)
        symmetry = self.yaw_symmetry
        if symmetry is None:
            is_round = is_square and 2 * self.radius < MAX_ROUND_RATIO * length
            symmetry = 4 if is_square else 2
            symmetry = 0 if is_round else symmetry
        offset = self.yaw_offset_deg
        if offset is None:
            offset = 90.0 if width > length and symmetry in (1, 2) else 0.0
            offset = 45.0 if symmetry == 4 else offset
        return {"yaw_symmetry": symmetry, "yaw_offset": math.radians(offset)}

    @model_validator(mode="after")
    def _check_model(self) -> ObjectConfig:
        if bool(self.urdf) == bool(self.mesh):
            raise ValueError("needs either a urdf or a mesh" + (", not both" if self.urdf else ""))
        if self.variants and not self.mesh:
            raise ValueError("has variants, so it needs a mesh")
        if self.ring >= self.radius:
            raise ValueError(
                f"has a ring of {self.ring:g} m, which must be smaller than the radius, {self.radius:g} m"
            )
        if self.footprint and max(self.footprint) > 2 * self.radius:
            raise ValueError(f"has a footprint longer than its diameter, 2 x {self.radius:g} m")
        for point in self.grasps:
            x, y, z = point.point
            if math.hypot(x, y) > self.radius or not 0 < z <= self.height:
                raise ValueError(
                    f"has a grasp point at {x:g}, {y:g}, {z:g} m, outside of the object: at most "
                    f"{self.radius:g} m from the middle, and up to {self.height:g} m above the underside"
                )
        if len({point.point[2] for point in self.grasps}) > 1:
            raise ValueError("has grasp points at several heights; they need the same z")
        if self.ring and self.grasp:
            raise ValueError("has a ring or grasp points, not both")
        if self.needs_yaw and not (self.footprint and self._derive_yaw_properties()["yaw_symmetry"]):
            raise ValueError(
                "needs a footprint for a grasp point beside the middle, and no yaw_symmetry of 0, so that "
                "images show its yaw"
            )
        if self.yaw_symmetry and not self.footprint:
            raise ValueError("needs a footprint for its yaw_symmetry; an outline must fit it")
        return self


class BinConfig(Section):
    """A container with a floor and four walls."""

    position: Vector
    """Centre of the underside of the floor: x, y, z [m]."""
    size: tuple[Length, Length, Length]
    """Inner length along x, inner width along y, wall height [m]."""
    slots: tuple[Count, Count] = (2, 3)
    """Numbers of drop positions along x and along y."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Colour of the walls."""
    place_yaw_deg: Angle | tuple[Angle, ...] | None = None
    """Angle of the objects in the bin, from the x axis of the world towards its y axis [degree]: one for all
    slots, or a list with one for each slot, in the order of their use (along y first). An object with a
    `yaw_symmetry` of 1 or 2 lies with the part of its outline that `yaw_offset_deg` names, its longer axis or
    the narrower end of it, in this direction, and any other object with the x axis of its model, up to its
    symmetry. A round object may lie at any angle. If not given, every object may. `Transit` brings no other
    object into such a bin if its yaw is unknown. A layer of objects is as high as the tallest class that is
    routed to the bin."""

    def build_bin(self, name: str) -> Bin:
        """Return the declared bin, with slots evenly distributed over the floor."""
        position = np.array(self.position)
        size = np.array(self.size)
        slot_indices = np.array([*np.ndindex(self.slots)])
        slots = position[:2] + size[:2] * ((slot_indices + 0.5) / self.slots - 0.5)
        angles = self.place_yaw_deg
        if angles is None:
            angles = ()
        elif not isinstance(angles, tuple):
            angles = (angles,) * len(slots)
        return Bin(name, position, size, slots, self.colour, tuple(map(math.radians, angles)))

    @model_validator(mode="after")
    def _check_place_yaws(self) -> BinConfig:
        slot_count = math.prod(self.slots)
        if isinstance(self.place_yaw_deg, tuple) and len(self.place_yaw_deg) != slot_count:
            count = len(self.place_yaw_deg)
            raise ValueError(f"needs one place_yaw_deg for each of its {slot_count} slots, not {count}")
        return self


class TableConfig(Section):
    """The workspace, which is the region of the table with objects, and the spawning of objects."""

    x: Range = (0.42, 0.64)
    """Range of the workspace along x [m]."""
    y: Range = (-0.22, 0.22)
    """Range of the workspace along y [m]."""
    objects: Annotated[tuple[Natural, Natural], AfterValidator(check_ascending)] = (3, 6)
    """Minimum and maximum number of spawned objects."""
    gap: Distance = 0.012
    """Minimum distance between the outlines of two spawned objects [m]."""
    stacked: Fraction = 0.0
    """Fraction of the objects that are spawned on another object; unstable objects fall down."""


class LedgerConfig(Section):
    """Thresholds of the ledger."""

    gate: Length = 0.025
    """Maximum distance between a detection and the item to which it is assigned [m]. The ledger increases
    this distance up to twice the value if the positions are uncertain."""
    neighbourhood: Distance = 0.07
    """Radius around a picked item within which other items may have been moved [m]."""
    max_miss_probability: float = Field(0.001, ge=1e-9, lt=1)
    """Maximum probability of a missed object at a position that is assumed to be empty."""
    max_class_error: float = Field(0.005, ge=1e-9, lt=1)
    """Maximum probability that the class of an item that is sorted is wrong."""
    max_position_std: Length = 0.005
    """Maximum standard deviation of the position of an item that may be picked [m]. After a failed grasp, the
    limit is two thirds of this value."""


class DetectorConfig(Section):
    """A detector, its thresholds, its declared error rates, and the options of its kind."""

    model_config = ConfigDict(extra="allow", frozen=True)

    kind: str
    """Kind of detector: the name of an entry point of the group `executive.detectors`."""
    threshold: float = Field(0.5, gt=0, lt=1)
    """Confidence below which a detection is doubtful, 0 to 1; a doubtful detection confirms no item."""
    floor: float = Field(0.25, gt=0, lt=1)
    """Minimum confidence of a detection; detections with a lower confidence are discarded."""
    latency: Seconds = 0.05
    """Time from the frame to the answer, on the clock of the run [s]."""
    miss_rate: float = Field(0.03, gt=0, lt=1)
    """Fraction of the completely visible objects that a fake detector misses in a frame. For other kinds,
    `executive evaluate` measures `miss_rate`, `confusion_rate`, `false_detections` and `jitter` instead."""
    confusion_rate: float = Field(0.004, gt=0, lt=1)
    """Fraction of the detected objects that get a wrong class."""
    false_detections: float = Field(0.02, gt=0, le=100)
    """Mean number of false detections (false positives) per frame."""
    jitter: float = Field(1.0, gt=0, le=1000)
    """Standard deviation of the random error of a box's centre, along each axis of the image [pixel]."""

    @model_validator(mode="after")
    def _check_floor(self) -> DetectorConfig:
        if self.floor > self.threshold:
            raise ValueError(f"needs a floor of at most its threshold {self.threshold:g}, not {self.floor:g}")
        return self

    @property
    def error_rates(self) -> ErrorRates:
        """Error rates that the cell file declares."""
        return ErrorRates(
            self.threshold, self.miss_rate, self.confusion_rate, self.false_detections, self.jitter
        )

    @property
    def options(self) -> dict[str, Any]:
        """Options of this kind of detector: all keys that are not fields of this class."""
        return dict(self.model_extra or {})


class UndeclaredConfig(Section):
    """Objects whose label is no class of the cell."""

    ignore: tuple[Name, ...] = ()
    """Labels whose objects may lie on the table: the run ignores their boxes. Any other object of no class
    is rejected, so that the run ends as INCOMPLETE."""
    meshes: tuple[str, ...] = ()
    """Paths or patterns (`others/*.obj`) of meshes of objects of no class, relative to the cell file. Some
    images of a dataset show them, so that a detector learns that they are none of its objects."""


class CellConfig(Section):
    """A cell: robot, tool, camera, table, bins, objects and detectors.

    Values are in SI units; values of keys that end in `_deg` are in degrees.
    """

    base: str = Field("", exclude=True)  # The loader merges the base file, and removes this key.
    """Path of a base file, from which this file inherits missing top-level keys, missing detectors and
    missing keys of detectors."""
    cell: Name
    """Name of the cell."""
    description: str = ""
    """Description of the cell in one sentence."""
    kind: str = "sim"
    """Kind of cell: `sim`, a simulated cell; `fake`, a cell without physics, for tests of missions; or the
    name of an entry point of the group `executive.drivers`."""
    arm: ArmConfig
    """Robot arm."""
    tool: SerializeAsAny[ToolModel]
    """Tool at the flange of the arm."""
    motion: MotionConfig = MotionConfig()
    """Distances, speeds and times of motion planning."""
    clock: ClockConfig = ClockConfig()
    """Time between two ticks of the behaviour tree."""
    table: TableConfig = TableConfig()
    """Workspace, and the objects that a simulated run spawns there."""
    bins: dict[Name, BinConfig] = Field(min_length=1)
    """Bins by name."""
    cameras: dict[Name, CameraConfig] = Field(min_length=1, max_length=1)
    """The camera by name; a cell has one camera."""
    detector: str = ""
    """Name of the detector that skills use by default; if not given, the first of `detectors`."""
    detectors: dict[Name, DetectorConfig] = Field(min_length=1)
    """Detectors by name. A detector of the base file keeps the keys that this file does not override, is
    replaced if this file declares another kind, and is removed if its name has no value in this file."""
    localization: Literal["plane", "depth", "ray"] = "plane"
    """Source of the height of a detected object: `plane`, the height of its class; `depth`, the depth image;
    `ray`, a ray test of the simulator."""
    objects: dict[Name, ObjectConfig] = Field(min_length=1)
    """Classes of objects by the label that the detectors report."""
    unknown: UndeclaredConfig = UndeclaredConfig()
    """Objects whose label is no class of the cell."""
    ledger: LedgerConfig = LedgerConfig()
    """Thresholds of the ledger, which tracks the objects."""
    safe_place: Vector
    """Position on the table at which `PutDown` puts down an object: x, y, z [m]."""

    @property
    def needs_yaw(self) -> bool:
        """True if images must show the yaws of objects, for the grasps of the tool or for a bin."""
        needs = [bin.place_yaw_deg is not None for bin in self.bins.values()]
        return self.tool.needs_yaw or any([*needs, *(model.needs_yaw for model in self.objects.values())])

    @property
    def max_object_height(self) -> float:
        """Height of the highest class of objects [m]."""
        return max(section.height for section in self.objects.values())

    @property
    def max_hold_height(self) -> float:
        """Largest distance from the tool centre point down to the underside of a held object [m]."""
        classes = (section.build_class(label) for label, section in self.objects.items())
        return max(map(self.tool.get_hold_height, classes))

    @property
    def max_pile_height(self) -> float:
        """Maximum height of a pile on the table [m]: two objects if `stacked` is above 0, else one."""
        return (2 if self.table.stacked else 1) * self.max_object_height

    @property
    def travel_height(self) -> float:
        """Tool height [m] at which a held object of any class clears all bin walls and piles."""
        wall_top = max(bin.position[2] + bin.size[2] for bin in self.bins.values())
        return max(wall_top, self.max_pile_height) + self.max_hold_height + self.motion.clearance

    def build_classes(self) -> dict[str, ObjectClass]:
        """Return the classes by label; objects lie on others only in a cell with `stacked` above 0."""
        classes = {label: section.build_class(label) for label, section in self.objects.items()}
        if not self.table.stacked:
            return classes
        heights = (0.0, *(object_class.height for object_class in classes.values()))
        return {label: replace(each, support_heights=heights) for label, each in classes.items()}

    def build_bins(self) -> dict[str, Bin]:
        """Return the bins by name."""
        return {name: section.build_bin(name) for name, section in self.bins.items()}

    @field_validator("detectors")
    @classmethod
    def _put_default_first(
        cls, detectors: dict[str, DetectorConfig], info: ValidationInfo
    ) -> dict[str, DetectorConfig]:
        """Put the default detector first, because skills use the first detector by default."""
        default = info.data.get("detector") or next(iter(detectors))
        if default not in detectors:
            names = ", ".join(detectors)
            raise ValueError(f'must contain the default detector "{default}"; there are: {names}')
        return {default: detectors[default], **detectors}
