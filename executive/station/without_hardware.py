"""What simulated and fake cell share: the base class, and the true positions of the objects at the end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.cell.arm import Arm
from executive.cell.config import CellConfig
from executive.cell.objects import UNKNOWN_LABEL, Bin
from executive.cell.protocols import STEP, Cell, Detector, Localizer, Routes, StepClock, Tool
from executive.cell.workcell import AUDIT_KEYS, CellOptions, TrueObject, Visuals
from executive.events import Emit, TargetSelected
from executive.geometry import Array
from executive.ledger.item import ItemRecord, State
from executive.ledger.tracker import Tracker
from executive.perception.camera_model import MountedCamera
from executive.perception.detectors.requests import screen_detectors


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

    A removed object counts only if it was seen: by its bin if the tool placed it there, else as `elsewhere`.
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
        if is_seen:
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


class SilentOperator:
    """Operator without a terminal, who requests the classes of a list in order."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        del choices
        return self._requests.pop(0) if self._requests else None


class CellWithoutHardware:
    """Clock, bins, classes and ledger of a cell; implements `executive.cell.workcell.Workcell`.

    Arm, tool, camera, detectors and localizer of `cell` are None until a subclass adds them. A replay uses
    this class itself.

    Args:
        config: The cell file.
        seed: Random seed of the run; not used.
        routes: Names of the permitted bins of each class.
        emit: Receives the events of the cell.
        options: Options of the run.

    Attributes:
        config: The cell file.
        routes: Names of the permitted bins of each class.
        accounts: The ledger of the run.
        cell: The interface of the cell for skills.
        steps: Number of control steps since the start of the run.
        last_command_step: Control step of the last logged command to arm or tool; 0 if there is none.
    """

    def __init__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> None:
        del seed
        self.config = config
        self.routes = dict(routes)
        self.steps = 0
        self.last_command_step = 0
        bins = config.build_bins()
        classes = {label: section.build_class(label) for label, section in config.objects.items()}
        ignored = set(config.unknown.ignore).difference(classes)
        self.accounts = Tracker(
            config.ledger,
            config.table,
            bins,
            classes,
            self.routes,
            options.quotas,
            emit,
            ignored,
            config.tool.find_distinct_labels(classes),
        )
        no_device: Any = None

        self.cell = Cell(
            clock=StepClock(lambda: self.steps * STEP),
            arm=no_device,
            tool=no_device,
            camera=no_device,
            detectors=dict.fromkeys(config.detectors, no_device),
            ledger=self.accounts,
            operator=options.operator,
            bins=bins,
            classes=classes,
            routes=self.routes,
            localizer=no_device,
            safe_place=np.array(config.safe_place),
            tool_model=config.tool,
            motion=config.motion,
            report_selection=lambda target, bin: emit(
                TargetSelected(target.item, target.label, target.frame, bin)
            ),
            quotas=options.quotas,
        )

    def _connect(
        self,
        options: CellOptions,
        arm: Arm,
        tool: Tool,
        camera: MountedCamera,
        detectors: Mapping[str, Detector],
        localizer: Localizer,
    ) -> None:
        """Add the parts that skills use to `cell`; the camera of a resumed run continues to count."""
        if options.resume is not None:
            camera.set_counts(options.resume.frame_count, options.resume.pose_count)
        screened = screen_detectors(detectors, self.cell.classes)
        self.cell = replace(
            self.cell, arm=arm, tool=tool, camera=camera, detectors=screened, localizer=localizer
        )

    def log_to(self, path: Path) -> None:
        """Do nothing: without hardware or physics, there is no world to log."""

    def advance(self) -> None:
        self.steps += 1

    def visuals(self) -> Visuals | None:
        return None

    def audit(self) -> Mapping[str, int] | None:
        if (objects := self._list_final_objects()) is None:
            return None
        gate = self.config.ledger.gate
        ignored = self.accounts.ignored_positions
        return count_outcomes(objects, self.accounts.records, self.cell.bins, self.routes, gate, ignored)

    def _list_final_objects(self) -> Iterable[TrueObject] | None:
        """Return all objects at the end of the run; None if their true positions are unknown."""
        return None

    def close(self) -> None:
        """Do nothing: the cell holds no resources."""
