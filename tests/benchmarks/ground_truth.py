"""Simulated runs with the true end of every object, and what the executive itself reported about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.behaviours import load_skills
from executive.cell.devices import TrueObject
from executive.cell.objects import BIN_THICKNESS, UNKNOWN_LABEL
from executive.drivers.sim.driver import MIN_CENTRE_HEIGHT, SimDriver
from executive.events import ItemChanged
from executive.ledger.item import State
from executive.mission.load import load_mission
from executive.perception.detectors.detector_registry import KindMaker, make_installed_kind
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.run.assembly import RunOptions
from executive.station.check import load_checker
from executive.station.station import Station, count_outcomes
from tests.benchmarks.forks import ForkRunner

HUNG = "HUNG"
"""Status of a run that exceeded its wall time."""
FAULT = "FAULT"
"""Status of a run whose process ended without a result."""
WALL_TIME_LIMIT = 180.0
"""Wall time after which a run counts as hung and is killed, unless an option says otherwise [s]."""
END_PLACES = ("wrong_bin", "right", "left", "elsewhere")
"""Keys of the audit of which a single object counts in one at most."""


@dataclass(frozen=True)
class Report:
    """Class and state of an item after its last change in the journal, with the reason of the state or "".

    `bin` is the bin into which it was placed, or "".
    """

    label: str
    state: str
    reason: str
    bin: str = ""

    @property
    def is_doubted(self) -> bool:
        """True if it tells a reader that the item may not be where it belongs."""
        return self.state in ("rejected", "lost") or (self.state == "placed" and bool(self.reason))

    def names_object(self) -> bool:
        """Return True if it tells a reader that an object is not in its bin."""
        return self.state in ("rejected", "lost", "skipped")


@dataclass(frozen=True)
class FoundObject:
    """The true end of an object.

    Attributes:
        label: True class, or `unknown`.
        place: One of `END_PLACES`; "" for an unknown object outside of bins that no item was seen near.
        bin: The bin that it lies in; None or "" outside of all bins.
        fell_in_wrong_bin: True if it fell from the tool into a wrong bin; `place` is then `elsewhere`.
        items: Items that stand for it: the one with which it was carried last, else those first seen where
            it stood.
        reports: What the journal says last about these items.
        true_place: The bin of the world that contains it, whatever the cell file says about bins; `tool`,
            `floor` or `table`.
        is_sorted: True if `true_place` is a permitted bin of its class.
        was_carried: True if the tool held it at any time.
    """

    label: str
    place: str
    bin: str | None
    fell_in_wrong_bin: bool
    items: tuple[str, ...]
    reports: tuple[Report, ...] = ()
    true_place: str = ""
    is_sorted: bool = False
    was_carried: bool = False

    @property
    def is_in_wrong_bin(self) -> bool:
        """True if it was put or fell into a wrong bin."""
        return self.place == "wrong_bin" or self.fell_in_wrong_bin


@dataclass(frozen=True)
class AuditedRun:
    """A run, its result and the true end of its objects.

    Attributes:
        mission: Name of the mission.
        seed: Seed of the run.
        status: Status in `result.json`, `HUNG` or `FAULT`.
        message: Message of the result, or why there is none.
        objects: The objects; none if there is no result.
        robot_time: Time on the clock of the run [s].
        run: Run directory; "" if there is none.
        items: What the journal says last about each item.
        unexplained_count: Number of entries `unexplained` of the result.
    """

    mission: str
    seed: int
    status: str
    message: str
    objects: tuple[FoundObject, ...] = ()
    robot_time: float = 0.0
    run: str = ""
    items: tuple[Report, ...] = ()
    unexplained_count: int = 0

    @property
    def known(self) -> list[FoundObject]:
        """The objects of the cell's classes."""
        return [one for one in self.objects if one.label != UNKNOWN_LABEL]

    @property
    def right(self) -> int:
        """Number of objects of the cell's classes in a right bin."""
        return sum(one.place == "right" for one in self.known)

    @property
    def in_wrong_bin(self) -> list[FoundObject]:
        """The objects in a wrong bin, unknown ones included."""
        return [one for one in self.objects if one.is_in_wrong_bin]

    @property
    def unreported(self) -> list[FoundObject]:
        """The objects in a wrong bin that the executive itself, without the audit, does not report.

        An object is reported if the status is not SUCCESS and one of its items is rejected, lost, or placed
        with a doubt.
        """
        return [
            one
            for one in self.in_wrong_bin
            if self.status == "SUCCESS" or not any(report.is_doubted for report in one.reports)
        ]


class AuditedCell(Station):
    """A station of a simulated cell that tells the true end of every object after `audit`.

    Attributes:
        objects: The objects; empty before `audit`.
    """

    driver: SimDriver

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.tick_callbacks.append(self._note_carried_item)
        self.objects: tuple[FoundObject, ...] = ()
        self._carried: dict[int, str] = {}

    def _note_carried_item(self) -> None:
        """Note the item with which a body is carried."""
        body = self.driver.tool.held_body
        if body is not None:
            for record in self.ledger.records:
                if record.state is State.HELD:
                    self._carried[body] = record.item

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects, and keep it object by object."""
        self.objects = tuple(map(self._find, self.driver.list_final_objects()))
        return super().audit()

    def _find(self, final_object: TrueObject) -> FoundObject:
        """Return the true end of an object."""
        gate = self.config.ledger.gate
        records = self.ledger.records
        counts = count_outcomes([final_object], records, self.cell.bins, self.routes, gate)
        items = [
            record.item
            for record in records
            for position in final_object.rest_positions
            if np.linalg.norm(record.first_position[:2] - position[:2]) <= gate
        ]
        if final_object.body in self._carried:
            items = [self._carried[final_object.body]]
        place = self.find_true_place(final_object)
        return FoundObject(
            label=final_object.label,
            place=next((place for place in END_PLACES if counts[place]), ""),
            bin=final_object.bin,
            fell_in_wrong_bin=bool(counts["fell_in_wrong_bin"]),
            items=tuple(dict.fromkeys(items)),
            true_place=place,
            is_sorted=place in self.routes.get(final_object.label, ()),
            was_carried=final_object.body in self._carried,
        )

    def find_true_place(self, true_object: TrueObject) -> str:
        """Return `FoundObject.true_place` of an object."""
        if self.driver.tool.held_body == true_object.body:
            return "tool"
        if true_object.position[2] < MIN_CENTRE_HEIGHT:
            return "floor"
        world = self.driver.world
        for name, body in world.bin_bodies.items():
            centre = np.array(world.client.getBasePositionAndOrientation(body)[0])
            if replace(self.cell.bins[name], position=centre).contains(true_object.position, BIN_THICKNESS):
                return name
        return "table"


Change = Callable[[AuditedCell], None]
"""Function that changes a station before its run."""


def run_audited(
    mission: str,
    seed: int,
    runs: Path,
    scene: Path | None = None,
    make_detector: KindMaker = make_installed_kind,
    wall_time_limit: float = WALL_TIME_LIMIT,
    change: Change = lambda _: None,
) -> AuditedRun:
    """Record a run below `runs` in a forked process, which is killed after `wall_time_limit` [s].

    `change` is called with the station before the run.
    """
    answer, problem = ForkRunner(wall_time_limit).call(
        lambda: _run_in_this_process(mission, seed, runs, scene, make_detector, change)
    )
    if isinstance(answer, AuditedRun):
        return answer
    return AuditedRun(mission, seed, HUNG if "was killed" in problem else FAULT, problem)


def _run_in_this_process(
    mission: str, seed: int, runs: Path, scene: Path | None, make_detector: KindMaker, change: Change
) -> AuditedRun:
    cells: list[AuditedCell] = []

    def make_cell(*arguments: Any, **options: Any) -> AuditedCell:
        cells.append(AuditedCell(*arguments, **options, make_detector=make_detector))
        change(cells[0])
        return cells[0]

    loaded = load_mission(mission, load_skills(), {}, load_checker)
    driver_options = {"scene": str(scene)} if scene else {}
    options = RunOptions(seed, make_cell=make_cell, driver_options=driver_options)
    result = record_run(loaded, options, runs, RecordOptions(saves_pictures=False))
    reports = read_reports(Path(result.run))
    objects = tuple(
        replace(one, reports=tuple(reports[item] for item in one.items if item in reports))
        for one in cells[0].objects
    )
    return AuditedRun(
        mission, seed, result.status, result.message, objects, result.robot_time_s, result.run,
        tuple(reports.values()), len(getattr(result, "unexplained", ())),
    )  # fmt: skip


def read_reports(run: Path) -> dict[str, Report]:
    """Return what the journal of a run directory says last about each item."""
    events = (timed.event for timed in read_journal(run / "journal.jsonl"))
    return {
        event.item: Report(event.label, event.state, event.reason, event.bin)
        for event in events
        if isinstance(event, ItemChanged)
    }
