"""Runs in which one source of information is wrong, and silent ends: SUCCESS although the world is otherwise.

The sources are the detector, the seal, the camera, the load cell, the cell file, and what the executive
assumes: that objects have the shape of their class, and that only the robot moves them. The cases are in
`wrong_sources.yaml`.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from executive.cell.config import ObjectConfig
from executive.cell.device_config import NoiseConfig
from executive.cell.devices import CameraImage, TrueObject
from executive.cell.frame import Detection, Frame
from executive.cell.objects import BIN_THICKNESS, UNKNOWN_LABEL
from executive.drivers.sim.camera import add_noise
from executive.drivers.sim.models import DROP_HEIGHT, load_mesh
from executive.errors import Fault
from executive.geometry import Pose, rotate_about_z
from executive.perception.camera_model import project
from executive.processes import WorkerPool
from executive.station.border import Access
from tests.benchmarks.ground_truth import (
    FAULT,
    HUNG,
    WALL_TIME_LIMIT,
    AuditedCell,
    AuditedRun,
    Report,
    run_audited,
)
from tests.benchmarks.report import Figures, run_command, show_progress, write_json

CASES = Path(__file__).with_suffix(".yaml")
"""File with the cases by kind of wrong source; its first lines describe the keys."""
USUAL_TIMES = {"sort_overhead": 2.2, "sort_wrist": 2.6, "sort_stacked": 3.0, "weigh_and_sort": 3.2}
"""Median robot time per object by mission, in declared cells [s]; the cases `declared` measure it again."""
MAX_TIME_RATIO = 3.0
"""Largest robot time per object, relative to the usual one."""
END_TIME_RATIO = 4.0
"""Robot time per object, relative to the usual one, at which a run is ended."""
SEEDS_PER_CASE = 20
"""Distance between the first seeds of two cases, and the largest number of runs of a case."""
NEW_NOISE = NoiseConfig(gain=0.01, read=2.0)
"""Noise that is added to a frozen image."""
BOX = """<robot name="box"><link name="box">
<inertial><mass value="{mass}"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
<visual><geometry><box size="{0} {1} {2}"/></geometry></visual>
<collision><geometry><box size="{0} {1} {2}"/></geometry></collision></link></robot>"""
"""URDF of a box."""
BOX_DENSITY = 800.0
"""Density of boxes [kg/m³]."""
Numbers = Sequence[float]
"""Type of the lists of numbers in `CASES`."""


# Wrong sources, whose names are the keys of changes in the cases. One that returns False has to wait.


def hide(
    station: AuditedCell, label: str = "", bodies: Numbers = (), colour: Numbers = (), patch: Numbers = ()
) -> None:
    """Let the detectors never report some detections.

    Args:
        station: The station of the run.
        label: Class of the hidden objects.
        bodies: Numbers of the hidden objects, from 0.
        colour: Colour of the hidden objects; empty: none.
        patch: Left, top, right and bottom of the hidden region of the image [pixel]; empty: none.
    """
    world = station.driver.world
    first_body = min(world.labels)
    views: dict[str, tuple[Frame, Sequence[TrueObject]]] = {}

    def is_hidden(detection: Detection, frame: Frame, objects: Sequence[TrueObject]) -> bool:
        pixels = project(frame.matrix, frame.X_WC, [each.position for each in objects])
        nearest = objects[int(np.linalg.norm(pixels - detection.centre, axis=1).argmin())]
        true_colour = world.client.getVisualShapeData(nearest.body)[0][7][:3]
        x, y = detection.centre
        is_in_patch = bool(patch) and patch[0] <= x <= patch[2] and patch[1] <= y <= patch[3]
        has_colour = bool(colour) and np.allclose(true_colour, colour, atol=0.01)
        return nearest.label == label or nearest.body - first_body in bodies or has_colour or is_in_patch

    def intercept(access: Access) -> Any:
        result = access.proceed()
        if access.path == "detector.request":
            views[access.name] = access.arguments[0], station.driver.list_objects()
        elif access.path == "request.result" and access.name in views:
            for name in ("confident", "doubtful", "unknown"):
                seen = [each for each in getattr(result, name) if not is_hidden(each, *views[access.name])]
                result = replace(result, **{name: tuple(seen)})
        return result

    station.border.interceptor = intercept


def falsify(station: AuditedCell, attribute: str, value: str) -> None:
    """Let everybody who reads an attribute of the tool get the value of an expression.

    The expression may contain the true `value`, `was_true` (it was true at some time), `tool`, and `random`
    (a number from 0 to 1 that changes with each physics step).
    """
    tool: Any = station.driver.tool
    kind = type(tool)
    names = {"tool": tool, "was_true": False}

    def read(tool: Any) -> Any:
        true_value = vars(tool)[attribute] if attribute in vars(tool) else getattr(kind, attribute).fget(tool)
        names["was_true"] |= bool(true_value)
        random = np.random.default_rng(station.driver.world.step_count).random()
        return eval(value, {**names, "value": true_value, "random": random})

    value_property = property(read, lambda tool, true_value: vars(tool).update({attribute: true_value}))
    tool.__class__ = type(kind.__name__, (kind,), {attribute: value_property})


def fail_grasps(station: AuditedCell, numbers: Numbers) -> None:
    """Let the tool grip nothing in some of its grasps, from 1, but report a seal until it opens."""
    tool: Any = station.driver.tool
    close = tool.close
    find_grip = tool._find_grip
    tool.grasp_count = 0

    def close_and_count() -> None:
        tool.grasp_count += tool.is_idle
        close()

    tool.close = close_and_count
    tool._find_grip = lambda bodies: None if tool.grasp_count in numbers else find_grip(bodies)
    falsify(station, "holding", f"value or (tool.grasp_count in {numbers} and not tool.is_idle)")


def film(
    station: AuditedCell, image: str = "new", stamp: str = "new", pixels: str = "pixels", first: int = 0
) -> None:
    """Change all images after the number `first`.

    Args:
        station: The station of the run.
        image: `frozen`: always that with the number `first`; `late`: that before.
        stamp: `frozen`: always that of the image with the number `first`.
        pixels: Expression of the true `pixels`, with `cv2` and `add_noise`.
        first: Number of the last image without a change; 0: all are changed.
    """
    camera: Any = station.driver.camera
    capture = camera.capture
    images: list[CameraImage] = []
    sources = {"new": -1, "late": -2, "frozen": first - 1}

    def capture_changed() -> CameraImage:
        images.append(capture())
        if len(images) <= first:
            return images[-1]
        changed = images[sources[image]]._replace(stamp=images[sources[stamp]].stamp)
        rng = np.random.default_rng(len(images))
        names = {"cv2": cv2, "add_noise": partial(add_noise, noise=NEW_NOISE, rng=rng)}
        for name in ("colour", "depth")[: 1 if changed.depth is None else 2]:
            changed = changed._replace(**{name: eval(pixels, {**names, "pixels": getattr(changed, name)})})
        return changed

    camera.capture = capture_changed


def put_bin(station: AuditedCell, name: str, place: Numbers = (), colour: Numbers = ()) -> None:
    """Put the bin of the world to another place [m], or paint it."""
    world = station.driver.world
    body = world.bin_bodies[name]
    if place:
        world.client.resetBasePositionAndOrientation(body, [*place, 0.0], [0, 0, 0, 1])
    for index in range(len(world.client.getVisualShapeData(body)) if colour else 0):
        world.client.changeVisualShape(body, -1, index, rgbaColor=[*colour, 1])


def pile(
    station: AuditedCell, bodies: Sequence[Any], bin: str = "", colour: Numbers = (0.85, 0.2, 0.18)
) -> None:
    """Put bodies in place of the first object, or into a bin, each with an offset x, y, z [mm] or none.

    A body is a class, or length, width and height of a box [mm], which is an unknown object.
    """
    world = station.driver.world
    first = station.driver.list_objects()[0]
    base = [*station.cell.bins[bin].position[:2], BIN_THICKNESS] if bin else [*first.position[:2], 0.0]
    if not bin:
        world.remove_object(first.body, is_counted=False)
    for body, *offset in bodies:
        x, y, z = np.add(base, np.array(offset or [0, 0, 0]) / 1000)
        model = world.config.objects[body] if isinstance(body, str) else _make_box(body)
        # The angle differs between seeds, as the place does.
        X_WO = Pose(rotate_about_z(100 * x), np.array([x, y, z + DROP_HEIGHT - load_mesh(model).bottom]))
        label = body if isinstance(body, str) else UNKNOWN_LABEL
        world.rest_positions[world.add_object(label, X_WO, colour, model)] = [X_WO.position]
    world.settle(list(world.labels))


def _make_box(size: Numbers) -> ObjectConfig:
    sides = np.array(size) / 1000
    path = Path(tempfile.mkdtemp()) / "box.urdf"
    path.write_text(BOX.format(*sides, mass=BOX_DENSITY * sides.prod()))
    return ObjectConfig(urdf=str(path), height=sides[2], radius=float(np.hypot(*sides[:2]) / 2))


def move(station: AuditedCell, source: str = "table", goal: Numbers = (), count: int = 1) -> bool:
    """Move the first objects from the table, or from a bin, into a wrong bin, or to a goal [m] in a row."""
    places = station.cell.bins if source == "bin" else (source,)
    objects = [each for each in station.driver.list_objects() if station.find_true_place(each) in places]
    for number, each in enumerate(objects[:count]):
        right_bins = station.routes.get(each.label, ())
        wrong_bin = next(bin for name, bin in station.cell.bins.items() if name not in right_bins)
        # Wrong bins may contain something in the middle.
        offset = [0.0, 0.07 * number, 0.0] if goal else [0.05, 0.08, 0.05]
        position = np.add(goal or wrong_bin.position, offset)
        station.driver.world.place_object(each.body, Pose(each.X_WO.rotation, position))
    return bool(objects)


def drop(station: AuditedCell, goal: Numbers = ()) -> bool:
    """Let the tool lose the object that it holds, which falls there or lands at a goal [m]."""
    held = station.driver.find_held_object()
    if held is not None:
        station.driver.drop_held_object()
        if goal:
            station.driver.world.place_object(held.body, Pose.of(goal))
    return held is not None


CHANGES = {each.__name__: each for each in (hide, falsify, fail_grasps, film, put_bin, pile, move, drop)}
"""Functions that make a source wrong, by name."""


@dataclass(frozen=True)
class Case:
    """A mission with a wrong source.

    Attributes:
        kind: Kind of the wrong source.
        name: What is wrong.
        number: Position among all cases, from which its seeds follow.
        mission: Shipped name of the mission.
        changes: Functions of `CHANGES` with their arguments; `at`: time at which one is called [s].
        scene: Content of the scene file; empty: the world as the cell file declares it.
        first_seed: Seed of the first run, or None.
    """

    kind: str
    name: str
    number: int
    mission: str
    changes: Sequence[Mapping[str, Any]] = ()
    scene: Mapping[str, Any] = field(default_factory=dict)
    first_seed: int | None = None

    def __str__(self) -> str:
        return f"{self.mission}: {self.kind}: {self.name}"

    def install(self, station: AuditedCell) -> None:
        """Make the source wrong, now or in a tick, and end the run when it takes too long."""
        clock = station.driver.clock
        pending = list(self.changes)
        limit = END_TIME_RATIO * USUAL_TIMES[self.mission] * len(station.driver.list_objects())

        def advance() -> None:
            for change in list(pending):
                name = next(iter(change))
                if clock.now >= change.get("at", 0.0) and CHANGES[name](station, **change[name]) is not False:
                    pending.remove(change)
            if limit <= clock.now < limit + clock.step:
                raise Fault(f"the run has not ended after {limit:.0f} s on its clock")

        advance()
        station.tick_callbacks.append(advance)


def list_cases() -> Iterator[Case]:
    """Yield all cases."""
    numbers = count()
    for kind, entries in yaml.safe_load(CASES.read_text())["cases"].items():
        for entry in entries:
            for mission in entry.pop("missions", ["sort_overhead"]):
                yield Case(kind, number=next(numbers), mission=mission, **entry)


@dataclass(frozen=True)
class Done:
    """A run of a case."""

    case: Case
    run: AuditedRun

    @property
    def silence(self) -> str:
        """What a run that ended with SUCCESS does not say, else ""."""
        if self.run.status != "SUCCESS":
            return ""
        misplaced = [one for one in self.run.objects if not one.is_sorted]
        unnamed = [one for one in misplaced if not any(map(Report.names_object, one.reports))]
        sentences = [f"{one.label} in {one.true_place}" for one in unnamed]
        carried = [one for one in self.run.objects if one.was_carried and one.true_place.endswith("bin")]
        brought = Counter(f"{one.label} in {one.true_place}" for one in carried)
        placed = Counter(f"{item.label} in {item.bin}" for item in self.run.items if item.state == "placed")
        if placed != brought:
            sentences.append(f"{dict(placed)} was reported as placed, but {dict(brought)} was")
        return "; ".join(sentences)

    @property
    def is_unnamed(self) -> bool:
        """True if a run without SUCCESS names fewer items than objects are not where they belong."""
        misplaced_count = sum(not one.is_sorted for one in self.run.objects)
        named_count = sum(map(Report.names_object, self.run.items)) + self.run.unexplained_count
        return self.run.status in ("INCOMPLETE", "FAILURE") and misplaced_count > named_count

    @property
    def time_ratio(self) -> float:
        """Robot time per object relative to the usual one."""
        return self.run.robot_time / max(len(self.run.objects), 1) / USUAL_TIMES[self.case.mission]

    @property
    def problem(self) -> str:
        """What is wrong with the run, or ""."""
        if self.run.status in (FAULT, HUNG):
            return f"{self.run.status}: {self.run.message}"
        if self.silence:
            return f"silent: {self.silence}"
        return f"slow: {self.time_ratio:.1f} times the usual time" if self.time_ratio > MAX_TIME_RATIO else ""


def run_case(case: Case, seed: int, runs_folder: Path, limit: float) -> Done:
    """Run a case with a seed; `limit` is its largest wall time [s]."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.yaml"
        scene.write_text(yaml.safe_dump({"scene": case.name, **case.scene}))
        run = run_audited(case.mission, seed, runs_folder, scene, wall_time_limit=limit, change=case.install)
    return Done(case, run)


def measure(
    runs_folder: Path,
    out: Path = Path("wrong_sources.json"),
    only: str = "",
    seeds_per_case: int = 5,
    first_seed: int = 500000,
    wall_time_limit: float = WALL_TIME_LIMIT,
    workers: int = 2,
) -> Figures:
    """Run missions with a wrong detector, seal, cell file, camera or load cell, and with wrong assumptions.

    `--only` is a regular expression that `MISSION: KIND: NAME` contains. A problem is a run that is silent,
    that has no result, or that takes more than three times the usual robot time. A run is silent if it ends
    with SUCCESS while an object is not in its bin and no item says so, or while the bins do not contain what
    the items say.
    """
    with WorkerPool(workers) as pool:
        jobs = []
        for case in list_cases():
            first = case.first_seed or first_seed + SEEDS_PER_CASE * case.number
            run_count = min(seeds_per_case, SEEDS_PER_CASE) if re.search(only, str(case)) else 0
            for seed in range(first, first + run_count):
                jobs.append(pool.submit(run_case, case, seed, runs_folder, wall_time_limit))
        done = [job.result() for job in show_progress(jobs, "wrong sources")]
    figures = {"runs": len(done), "first_seed": first_seed, **summarize(done)}
    all_runs = [{"name": str(each.case), "problem": each.problem, **asdict(each)} for each in done]
    write_json(out, {**figures, "all_runs": all_runs})
    return figures


def summarize(done: Sequence[Done]) -> Figures:
    """Return a row per kind and in total, and the problems."""
    kinds = dict.fromkeys(each.case.kind for each in done)
    rows = [_make_row(kind, [each for each in done if each.case.kind == kind]) for kind in kinds]
    problems = [f"{each.case}, seed {each.run.seed}: {each.problem}" for each in done if each.problem]
    return {"kinds": [*rows, _make_row("total", done)], "problems": problems}


def _make_row(kind: str, done: Sequence[Done]) -> Figures:
    statuses = [each.run.status for each in done]
    return {
        "kind": kind,
        "runs": len(done),
        "silent": sum(bool(each.silence) for each in done),
        "unnamed": sum(each.is_unnamed for each in done),
        **{each: statuses.count(each) for each in ("SUCCESS", "INCOMPLETE", "FAILURE", FAULT, HUNG)},
        "slowest ratio": max((each.time_ratio for each in done), default=0.0),
    }


if __name__ == "__main__":
    run_command(measure)
