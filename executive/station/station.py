"""The station: everything above the devices of a cell, and the cell as skills see it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.devices import (
    DEFAULT_ROLE,
    DeviceClock,
    Driver,
    DriverKind,
    DriverOptions,
    RayCaster,
    Rebuildable,
    TrueObject,
    TrueWorld,
    Visible,
    Visuals,
    derive_seeds,
    is_rehearsal,
    load_driver_kind,
)
from executive.cell.objects import UNKNOWN_LABEL, Bin, Quotas
from executive.cell.protocols import Behaviours, Cell, Operator, Routes
from executive.errors import InputError
from executive.events import Emit, TargetSelected
from executive.geometry import GRAVITY, Array
from executive.ledger.item import ItemRecord, State
from executive.ledger.tracker import Tracker
from executive.motion.joints import Kinematics, build_planning_kinematics
from executive.motion.planner import Planner
from executive.perception.detectors.cell_detector import TruthDetector, build_cell_detectors
from executive.perception.detectors.detector_registry import KindMaker, make_installed_kind
from executive.perception.localization import CellLocalizer
from executive.station.border import Border
from executive.station.camera import CellCamera, Robot
from executive.station.planner_service import PlannedArm, PlannerService
from executive.text.files import get_shipped_folder

DeviceT = TypeVar("DeviceT")
"""Type of a device."""


class SilentOperator:
    """Operator without a terminal, who requests the classes of a list in order."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next class of the list, or None at its end."""
        del choices
        return self._requests.pop(0) if self._requests else None


@dataclass(frozen=True)
class CellOptions:
    """Options of a run for its cell.

    Attributes:
        operator: The person or script that requests classes of objects.
        cell_folder: Folder of the cell file, to which paths in the file are relative.
        driver_options: Options of the driver by name; only the driver knows their meaning.
        world_log: Log from which the driver rebuilds its world, for a resumed run; None for a new run.
        has_devices: False for a replay, in which all values come from the record.
        quotas: Maximum numbers of objects in the bins, from the mission.
    """

    operator: Operator
    cell_folder: Path
    driver_options: Mapping[str, str] = field(default_factory=dict)
    world_log: Path | None = None
    has_devices: bool = True
    quotas: Quotas = field(default_factory=dict)


class Station:
    """What is built from the devices of a cell, its cell file and a mission.

    Args:
        config: The cell file.
        kind: Kind of the driver; None: the kind that the cell file names.
        seed: Random seed of the run.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run.
        make_detector: Makes the kind of each detector; None: the kind that the cell file names, or the truth
            in a cell without physics.

    Attributes:
        config: The cell file.
        routes: Names of the permitted bins of each class.
        driver: The devices; a replay has none.
        border: Border between the run and the devices, detectors, planner and operator.
        ledger: The ledger of the run.
        cell: The cell as skills see it.
        unrecorded_cell: The cell with an arm and a tool whose reads are not recorded.
        tick_count: Number of ticks since the start of the run, including those before a resumption.
        tick_callbacks: Functions that are called after each tick of the devices.

    Raises:
        InputError: The driver does not support the cell file or an option, or a detector cannot be built.
    """

    driver: Driver

    def __init__(
        self,
        config: CellConfig,
        kind: DriverKind | None = None,
        *,
        seed: int,
        routes: Routes,
        emit: Emit,
        options: CellOptions,
        make_detector: KindMaker | None = None,
    ) -> None:
        self.config = config
        self.routes = dict(routes)
        self.border = Border(emit)
        self.tick_count = 0
        self.tick_callbacks: list[Callable[[], None]] = []
        self._emptied_ticks: dict[str, int] = {}
        """Tick in which a bin was emptied, by name, until its objects disappear."""
        bins = config.build_bins()
        classes = config.build_classes()
        ignored_labels = set(config.unknown.ignore).difference(classes)
        self.ledger = Tracker(
            config.ledger,
            config.table,
            bins,
            classes,
            self.routes,
            options.quotas,
            emit,
            ignored_labels,
            config.tool.find_distinct_labels(classes),
        )
        camera_name = next(iter(config.cameras))
        with ExitStack() as resources:
            # In a replay, the border needs none of these parts, because all values come from the record.
            clock: Any = None
            arm: Any = None
            tool: Any = None
            camera_device: Any = None
            planner: Any = None
            detectors: Mapping[str, Any] = dict.fromkeys(config.detectors)
            cast_ray = None
            masses = {label: each.mass for label, each in classes.items() if math.isfinite(each.mass_std)}
            is_without_physics = kind is not None and is_rehearsal(kind)
            if options.has_devices:
                kind = kind or load_driver_kind(config.kind)
                is_without_physics = is_rehearsal(kind)
                if (compute_mass := getattr(kind, "compute_mass", None)) is not None:
                    masses = {label: compute_mass(section) for label, section in config.objects.items()}
                    classes = {label: replace(each, mass=masses[label]) for label, each in classes.items()}
                driver_options = DriverOptions(seed, options.cell_folder, options.driver_options)
                self.driver = kind(config, driver_options)
                resources.callback(self.driver.close)
                clock = self.driver.clock
                arm = _find_device(self.driver.arms, "arm", config.kind)
                tool = _find_device(self.driver.tools, "tool", config.kind)
                camera_device = _find_device(self.driver.cameras, "camera", config.kind, camera_name)
                if isinstance(self.driver, RayCaster):
                    cast_ray = self.driver.cast_ray
                if options.world_log is not None and isinstance(self.driver, Rebuildable):
                    self.tick_count = self.driver.rebuild(options.world_log)
            kinematics = build_planning_kinematics(config)
            poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
            if options.has_devices:
                planner = _build_planner(config, kinematics, clock, emit, is_without_physics)
                resources.callback(planner.close)
                truth = TruthDetector.from_config if is_without_physics else make_installed_kind
                detectors = build_cell_detectors(
                    config,
                    clock=clock,
                    cell_folder=options.cell_folder,
                    seed=derive_seeds(seed)[2],
                    classes=classes,
                    folders=(options.cell_folder, get_shipped_folder() / "cells"),
                    make_kind=make_detector or truth,
                )
                for detector in detectors.values():
                    resources.callback(detector.close)
            recorded_arm = self.border.wrap("arm", arm)
            recorded_tool = self.border.wrap("tool", tool)
            camera = CellCamera(
                config,
                self.border.wrap("image", camera_device),
                Robot(recorded_arm, recorded_tool),
                Robot(arm, tool),
                kinematics,
                get_change_count=lambda: self.ledger.change_count,
                is_hidden_by_arm=not is_without_physics,
            )
            method = "plane" if is_without_physics else config.localization
            localizer = CellLocalizer(
                method, classes, tuple(bins.values()), cast_ray, measures_yaw=config.needs_yaw
            )
            self.cell = Cell(
                clock=clock,
                arm=PlannedArm(recorded_arm, self.border.wrap("planner", planner), kinematics, poses),
                tool=recorded_tool,
                camera=self.border.wrap("camera", camera),
                detectors={
                    name: self.border.wrap("detector", each, name) for name, each in detectors.items()
                },
                ledger=self.ledger,
                operator=self.border.wrap("operator", options.operator),
                # No skill may change the mappings of the station.
                bins=MappingProxyType(bins),
                classes=MappingProxyType(classes),
                routes=MappingProxyType(self.routes),
                localizer=self.border.wrap("localizer", localizer),
                workspace=np.array([config.table.x, config.table.y]).T,
                safe_place=np.array(config.safe_place),
                tool_model=config.tool,
                motion=config.motion,
                report_selection=lambda target, bin: emit(
                    TargetSelected(target.item, target.label, target.frame, bin)
                ),
                empty_bins=self.empty_bins,
                quotas=options.quotas,
                # A replay has no driver, which may know the masses of objects.
                get_weight=lambda label: self.border.read(
                    f"weight.{label}", lambda: masses.get(label, 0.0) * GRAVITY
                ),
                behaviours=self.border.wrap("behaviours", Behaviours()),
            )
            self.unrecorded_cell = replace(
                self.cell, arm=PlannedArm(arm, planner, kinematics, poses), tool=tool
            )
            self._resources = resources.pop_all()

    def advance(self) -> None:
        """Wait for the next tick of the devices."""
        self.driver.clock.wait_for_tick()
        self.tick_count += 1
        self._remove_emptied_objects()
        for callback in self.tick_callbacks:
            callback()

    def empty_bins(self, names: Sequence[str]) -> None:
        """Record that bins have been emptied, without names all bins; unknown names are ignored.

        If the driver knows its world, the objects in the bins disappear after the next tick of the devices.
        """
        bins = [name for name in self.cell.bins if not names or name in names]
        self._emptied_ticks |= dict.fromkeys(bins, self.border.tick)
        self.ledger.empty_bins(bins)

    def _remove_emptied_objects(self) -> None:
        """Let the objects in the emptied bins disappear; only those in a wrong bin stay in the audit."""
        # A process may have been killed after the record of this tick, and before the objects disappeared.
        bins = [name for name, tick in self._emptied_ticks.items() if tick >= self.border.tick - 1]
        self._emptied_ticks.clear()
        if not bins or not isinstance(self.driver, TrueWorld):
            return
        final_objects = self.driver.list_final_objects()
        objects = [each for each in final_objects if not each.is_held and not each.is_removed]
        if objects and self.ledger.find_held_item() and self.driver.find_held_object() is None:
            # The ledger does not know yet that the nearest object has been released.
            tip = self.unrecorded_cell.arm.tool_pose.position
            objects.remove(min(objects, key=lambda each: math.dist(each.position, tip)))
        for each in objects:
            if each.bin in bins:
                self.driver.remove_object(each, is_counted=_find_place(each, self.routes) != "right")

    def log_to(self, path: Path) -> None:
        """Start a log of the world if the driver can rebuild its world; called before the first tick."""
        if isinstance(self.driver, Rebuildable):
            self.driver.log_to(path)

    def visuals(self) -> Visuals | None:
        """Return the shapes and poses of the bodies for displays, or None if the driver has no visuals."""
        return self.driver.visuals() if isinstance(self.driver, Visible) else None

    def audit(self) -> Mapping[str, int] | None:
        """Return the number of objects by true place, by `AUDIT_KEYS`; None without ground truth.

        An object that was taken out of an emptied bin is `right` unless it was in a wrong bin.
        """
        if not isinstance(self.driver, TrueWorld):
            return None
        # The run may have ended in the tick in which a bin was emptied.
        self._remove_emptied_objects()
        objects = self.driver.list_final_objects()
        gate = self.config.ledger.gate
        ignored_positions = self.ledger.foreign.ignored_positions
        counts = count_outcomes(
            objects, self.ledger.records, self.cell.bins, self.routes, gate, ignored_positions
        )
        counts["right"] += self.driver.forgotten_count
        return counts

    def close(self) -> None:
        """Release all resources; the station is unusable afterwards."""
        self._resources.close()


def _find_device(devices: Mapping[str, DeviceT], noun: str, kind: str, role: str = "") -> DeviceT:
    """Return the device with a role; without a role, the only device or that with `DEFAULT_ROLE`."""
    if not role:
        role = next(iter(devices)) if len(devices) == 1 else DEFAULT_ROLE
    if role not in devices:
        roles = ", ".join(devices) or "none"
        raise InputError(f'the driver "{kind}" has no {noun} with the name "{role}"; it has: {roles}')
    return devices[role]


def _build_planner(
    config: CellConfig, kinematics: Kinematics, clock: DeviceClock, emit: Emit, is_without_physics: bool
) -> PlannerService:
    """Return the planner service of a cell; without physics, motions have straight joint paths."""
    planning_time = config.motion.planning_time
    # Each cell needs only one planner; PyBullet and the libraries of the second one take 0.3 s to load.
    if is_without_physics:
        from executive.motion.planner import plan_straight_motion

        plan_straight = partial(plan_straight_motion, config, kinematics)
        return PlannerService(plan_straight, clock, planning_time, emit)
    # The import loads PyBullet, which takes 0.2 s; a cell without physics and a replay do not need it.
    from executive.physics.collision import ClearanceChecker

    checker = ClearanceChecker(config)
    planner = Planner(config, checker.check, kinematics)
    return PlannerService(planner.plan, clock, planning_time, emit, checker.close)


AUDIT_KEYS = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the object counts of an audit: objects in permitted bins (`right`), in other bins, on the table
(`left`), elsewhere; and, counted a second time, objects that fell into a wrong bin or were never detected."""


def count_outcomes(
    objects: Iterable[TrueObject],
    records: Sequence[ItemRecord],
    bins: Mapping[str, Bin],
    routes: Routes,
    max_distance: float,
    ignored_positions: Sequence[Array] = (),
) -> dict[str, int]:
    """Return the number of objects by outcome.

    * `right`: objects in a permitted bin
    * `wrong_bin`: objects in another bin, except objects that fell into it
    * `left`: objects on the table, and the held object
    * `elsewhere`: objects below the table, and objects that fell into a wrong bin
    * `fell_in_wrong_bin`: only the objects that fell into a wrong bin
    * `unseen`: objects that were never seen: the ledger contains no item, except phantoms, whose first
      position has a horizontal distance of at most `max_distance` [m] from a rest position of the object
      or from the centre of its bin

    A removed object counts only if it was seen, or in a wrong bin: by its bin if the tool placed it there,
    else as `elsewhere`.
    An object with `UNKNOWN_LABEL` that was never seen counts only if it is in a wrong bin, not as `unseen`;
    so does any other unseen object that was detected with an ignored label, at one of `ignored_positions`.
    """
    counts = dict.fromkeys(AUDIT_KEYS, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for final_object in objects:
        # For an item in a bin, a resumed run records the centre of the bin as first position.
        bin_centre = [bins[final_object.bin].position] if final_object.bin else []
        positions = (*final_object.rest_positions, *bin_centre)
        is_seen = _is_any_near(first_positions, positions, max_distance)
        if not is_seen and _is_any_near(ignored_positions, positions, max_distance):
            final_object = replace(final_object, label=UNKNOWN_LABEL)
        for key in _find_outcomes(final_object, _find_place(final_object, routes), is_seen):
            counts[key] += 1
    return counts


def _is_any_near(points: Sequence[Array], positions: Sequence[Array], max_distance: float) -> bool:
    """Return True if a point `(3,)` [m] is at most `max_distance` [m] from a position, seen from above."""
    return any(math.dist(point[:2], place[:2]) <= max_distance for point in points for place in positions)


def _find_outcomes(final_object: TrueObject, place: str, is_seen: bool) -> Iterator[str]:
    """Yield the keys of the counts that include an object with a final `place`."""
    if final_object.is_removed:
        # The ledger has no record of an object in an emptied bin.
        if is_seen or place == "wrong_bin":
            was_placed = place in ("right", "wrong_bin") and not final_object.is_dropped
            yield place if was_placed else "elsewhere"
    elif place == "wrong_bin" and final_object.is_dropped:
        yield from ("elsewhere", "fell_in_wrong_bin")
    elif place == "wrong_bin" or is_seen or final_object.label != UNKNOWN_LABEL:
        yield place
    if not (is_seen or final_object.is_removed or final_object.label == UNKNOWN_LABEL):
        yield "unseen"


def _find_place(final_object: TrueObject, routes: Routes) -> str:
    """Return `right`, `wrong_bin`, `left` or `elsewhere` for the final position, without regard to drops."""
    if final_object.is_held:
        return "left"
    if not final_object.bin:
        return "elsewhere" if final_object.bin is None else "left"
    return "right" if final_object.bin in routes.get(final_object.label, ()) else "wrong_bin"
