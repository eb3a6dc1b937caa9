"""Simulated runs with the true end of every object, and what the executive itself reported about it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.protocols import Routes
from executive.cell.workcell import CellOptions
from executive.cells.ground_truth import UNKNOWN_LABEL, FinalObject, count_outcomes
from executive.cells.sim.cell import SimCell, list_final_objects
from executive.events import Emit, ItemChanged
from executive.ledger.item import State
from executive.mission.load import load_mission
from executive.perception.detectors.requests import ClosableDetector
from executive.perception.envelope import build_rated_detectors
from executive.plugins import load_cell_kind, load_skills
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.result import find_exit_code
from executive.run.assembly import RunOptions
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.report import WALL_TIME_LIMIT

HUNG, FAULT = "HUNG", "FAULT"
"""Status of a run that exceeded its wall time, and of a run whose process ended without a result."""
END_PLACES = ("wrong_bin", "right", "left", "elsewhere")
"""Keys of the audit of which a single object counts in one at most."""
DetectorMaker = Callable[..., Mapping[str, ClosableDetector]]
"""Makes the detectors of a cell, as `build_rated_detectors` does."""


@dataclass(frozen=True)
class Report:
    """What the journal says last about an item.

    Attributes:
        label: Class.
        state: State.
        reason: Reason of the state, or "".
    """

    label: str
    state: str
    reason: str

    @property
    def is_doubted(self) -> bool:
        """True if it tells a reader that the item may not be where it belongs."""
        return self.state in ("rejected", "lost") or (self.state == "placed" and bool(self.reason))


@dataclass(frozen=True)
class FoundObject:
    """The true end of an object.

    Attributes:
        label: True class, or `unknown`.
        place: One of `END_PLACES`; "" for an unknown object outside of bins that no item was seen near.
        bin: The bin that it lies in, or "".
        fell_in_wrong_bin: True if it fell from the tool into a wrong bin; `place` is then `elsewhere`.
        items: Items that stand for it: the one with which it was carried last, else those first seen where
            it stood.
        reports: What the journal says last about these items.
    """

    label: str
    place: str
    bin: str
    fell_in_wrong_bin: bool
    items: tuple[str, ...]
    reports: tuple[Report, ...] = ()

    @property
    def is_known(self) -> bool:
        """True if it is of a class of the cell."""
        return self.label != UNKNOWN_LABEL

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
        exit_code: Exit code of `executive run`; -1 if there is no result.
        message: Message of the result, or why there is none.
        items: Counts of the ledger.
        audit: Counts of the audit, and `agrees`.
        objects: The objects; none if there is no result.
        robot_time_s: Time on the clock of the run [s]; without a result, as far as its journal tells.
        wall_time_s: Wall time [s].
        cpu_time_s: Processor time of the run's process, all threads [s].
        run: Run directory; "" if there is none.
    """

    mission: str
    seed: int
    status: str
    exit_code: int
    message: str
    items: Mapping[str, int]
    audit: Mapping[str, int | bool]
    objects: tuple[FoundObject, ...]
    robot_time_s: float
    wall_time_s: float
    cpu_time_s: float
    run: str

    @staticmethod
    def without_result(mission: str, seed: int, status: str, message: str) -> AuditedRun:
        """Return what is known of a run that ended without a result."""
        return AuditedRun(mission, seed, status, -1, message, {}, {}, (), 0.0, 0.0, 0.0, "")

    @property
    def known(self) -> list[FoundObject]:
        """The objects of the cell's classes."""
        return [one for one in self.objects if one.is_known]

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


class AuditedCell(SimCell):
    """A simulated cell that tells the true end of every object after `audit`.

    Attributes:
        objects: The objects; empty before `audit`.
    """

    def __init__(
        self,
        config: CellConfig,
        *,
        seed: int,
        routes: Routes,
        emit: Emit,
        options: CellOptions,
        build_detectors: DetectorMaker,
    ) -> None:
        super().__init__(
            config, seed=seed, routes=routes, emit=emit, options=options, build_detectors=build_detectors
        )
        self.objects: tuple[FoundObject, ...] = ()
        self._labels = dict(self._world.labels)
        self._carried: dict[int, str] = {}

    def advance(self) -> None:
        """Let one physics step pass, and note the item with which a body is carried."""
        super().advance()
        body = self._tool.held_body
        if body is None:
            return
        for record in self.accounts.records:
            if record.state is State.HELD:
                self._carried[body] = record.item

    def audit(self) -> dict[str, int]:
        """Return what really became of the objects, and keep it object by object."""
        final_objects = list_final_objects(self._world, self._tool, self.cell.bins)
        self.objects = tuple(map(self._find, self._world.rest_positions, final_objects))
        return super().audit()

    def _find(self, body: int, final_object: FinalObject) -> FoundObject:
        """Return the true end of a body."""
        places = self._world.rest_positions[body]
        gate = self.config.ledger.gate
        bins = self.cell.bins
        counts = count_outcomes([final_object], self.accounts.records, bins, self.routes, gate)
        seen_there = tuple(
            record.item
            for record in self.accounts.records
            if any(float(np.linalg.norm(record.first_position[:2] - place[:2])) <= gate for place in places)
        )
        carried = self._carried.get(body)
        inside = ""
        if body in self._world.labels:
            position = self._world.get_object_pose(body).position
            inside = next((name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS)), "")
        return FoundObject(
            label=self._labels[body],
            place=next((place for place in END_PLACES if counts[place]), ""),
            bin=inside,
            fell_in_wrong_bin=bool(counts["fell_in_wrong_bin"]),
            items=seen_there if carried is None else (carried,),
        )


class AuditedCellMaker:
    """Makes an audited cell and keeps it; `detectors` makes its detectors.

    Attributes:
        made: The cell; set once it is made.
    """

    made: AuditedCell

    def __init__(self, detectors: DetectorMaker = build_rated_detectors) -> None:
        self._detectors = detectors

    def __call__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> AuditedCell:
        """Return a cell made from a cell file."""
        self.made = AuditedCell(
            config, seed=seed, routes=routes, emit=emit, options=options, build_detectors=self._detectors
        )
        return self.made


def run_audited(
    mission: str,
    seed: int,
    runs: Path,
    scene: Path | None = None,
    detectors: DetectorMaker = build_rated_detectors,
    wall_time_limit: float = WALL_TIME_LIMIT,
) -> AuditedRun:
    """Record a run below `runs` in a forked process, which is killed after `wall_time_limit` [s]."""
    began = time.time()
    answer, problem = ForkRunner(wall_time_limit).call(
        lambda: _run_in_this_process(mission, seed, runs, scene, detectors)
    )
    if isinstance(answer, AuditedRun):
        return answer
    status = HUNG if "was killed" in problem else FAULT
    run = AuditedRun.without_result(mission, seed, status, problem)
    journals = runs.glob(f"*/*_s{seed}/journal.jsonl")
    journal = next((path for path in journals if path.stat().st_mtime >= began), None)
    if journal is None:
        return run
    clock = max((timed.clock for timed in read_journal(journal)), default=0.0)
    message = f"{problem}; its clock had come to {clock:.1f} s"
    return replace(run, message=message, robot_time_s=clock, run=str(journal.parent))


def _run_in_this_process(
    mission: str, seed: int, runs: Path, scene: Path | None, detectors: DetectorMaker
) -> AuditedRun:
    skills = load_skills()
    loaded = load_mission(mission, skills, {}, load_cell_kind)
    maker = AuditedCellMaker(detectors)
    options = RunOptions(seed, make_cell=maker, scene=scene)
    result = record_run(loaded, options, runs, RecordOptions(saves_pictures=False))
    reports = read_reports(Path(result.run) / "journal.jsonl")
    objects = tuple(
        replace(one, reports=tuple(reports[item] for item in one.items if item in reports))
        for one in maker.made.objects
    )
    return AuditedRun(
        mission=mission,
        seed=seed,
        status=result.status,
        exit_code=find_exit_code(result),
        message=result.message,
        items=asdict(result.items),
        audit=asdict(result.audit),
        objects=objects,
        robot_time_s=result.robot_time_s,
        wall_time_s=result.wall_time_s,
        # A forked process begins at zero.
        cpu_time_s=round(time.process_time(), 3),
        run=result.run,
    )


def read_reports(journal: Path) -> dict[str, Report]:
    """Return what a journal says last about each item, by item."""
    events = (timed.event for timed in read_journal(journal))
    changes = (event for event in events if isinstance(event, ItemChanged))
    return {change.item: Report(change.label, change.state, change.reason) for change in changes}
