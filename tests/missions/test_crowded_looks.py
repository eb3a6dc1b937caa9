"""A detector that fills every look with boxes ends the mission at once, with a reason and a short record."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.cell.config import CameraConfig, CellConfig, DetectorConfig
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Clock
from executive.cell.workcell import Workcell
from executive.cells.fake.cell import FakeCell
from executive.cells.sim.cell import SimCell
from executive.mission.load import load_mission
from executive.perception.detectors.requests import PendingSearch
from executive.perception.detectors.screening import screen_detectors
from executive.plugins import load_cell_kind, load_skills
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.result import Result
from executive.run.assembly import RunOptions

LABELS = ("cube", "sphere", "duck")
MAX_WALL_TIME = 60.0
"""Time within which the run must end, whatever the number of boxes [s]."""
MAX_JOURNAL_ENTRIES = 150
"""Maximum number of entries of the journal; the answer of the detector is in one of them."""


class CrowdedDetector:
    """Returns `count` boxes of known classes in every look; implements `executive.cell.protocols.Detector`.

    Args:
        count: Number of boxes.
        confidence: Confidence of every box.
        overlapping: Boxes of 30 pixels at random positions, instead of small ones side by side.
        moving: Draw positions and classes anew for every look.
    """

    def __init__(
        self, name: str, config: DetectorConfig, camera: CameraConfig, clock: Clock, *,
        count: int, confidence: float = 0.9, overlapping: bool = False, moving: bool = False,
    ) -> None:  # fmt: skip
        self._name, self._config, self._camera, self._clock = name, config, camera, clock
        self._count, self._confidence = count, confidence
        self._overlapping, self._moving = overlapping, moving

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Return boxes within the searched part of the image, whatever it shows."""
        assert frame.id == 1, "the mission goes on with a look that cannot be right"
        answer: Future[list[Detection]] = Future()
        camera = self._camera
        area = camera.table_view if view == "table" else (0, 0, camera.width, camera.height)
        answer.set_result(self._boxes(area, np.random.default_rng(frame.id if self._moving else 0)))
        due = self._clock.now + self._config.latency
        return PendingSearch(answer, due, self._clock, self._name, self._config.error_rates)

    def close(self) -> None:
        """Have nothing to give back."""

    def _boxes(self, area: tuple[int, int, int, int], random: np.random.Generator) -> list[Detection]:
        corner, size = np.array(area[:2]), np.array(area[2:]) - area[:2]
        columns = int(np.ceil(np.sqrt(self._count)))
        if self._overlapping:
            half = 15.0
            centres = random.uniform(corner + half, corner + size - half, (self._count, 2))
        else:
            half = float(size.min() / columns * 0.45)
            cells = random.permutation(columns * columns)[: self._count]
            centres = corner + (np.stack(divmod(cells, columns), axis=1) + 0.5) * size / columns
        return [
            Detection(str(random.choice(LABELS)), self._confidence, (x - half, y - half, x + half, y + half))
            for x, y in centres.tolist()
        ]


def _fake(config: Any, *, crowd: Mapping[str, Any], **given: Any) -> FakeCell:
    fake = FakeCell(config, **given)
    camera = next(iter(config.cameras.values()))
    parts: dict[str, Any] = {
        name: CrowdedDetector(name, detector, camera, fake.cell.clock, **crowd)
        for name, detector in config.detectors.items()
    }
    fake.cell.detectors.update(screen_detectors(parts, fake.cell.classes))  # type: ignore[attr-defined]
    return fake


def _crowded(
    config: CellConfig,
    *,
    clock: Clock,
    base: Path,
    seed: int,
    folders: Sequence[Path],
    crowd: Mapping[str, Any],
) -> dict[str, CrowdedDetector]:
    del base, seed, folders
    camera = next(iter(config.cameras.values()))
    return {
        name: CrowdedDetector(name, section, camera, clock, **crowd)
        for name, section in config.detectors.items()
    }


def run_crowded(
    runs: Path, kind: Callable[..., Workcell], mission: str = "sort_overhead"
) -> tuple[Result, str]:
    """Run a shipped mission and return its result and its journal."""
    skills = load_skills()
    loaded = load_mission(mission, skills, find_cell_kind=load_cell_kind)
    options = RunOptions(1, has_keyboard=False, make_cell=kind)
    result = record_run(loaded, options, runs, RecordOptions(saves_pictures=False))
    return result, (Path(result.run) / "journal.jsonl").read_text()


def assert_ended_as_crowded(result: Mapping[str, Any], journal: str, count: int) -> None:
    assert (result.status, result.reason) == ("FAILURE", "Detect.crowded")
    assert result.message.startswith(f"detector embedded found {count} boxes in the view")
    assert "at most 60 are allowed" in result.message
    assert result.wall_time_s < MAX_WALL_TIME
    entries = [json.loads(line)["kind"] for line in journal.splitlines()]
    assert len(entries) < MAX_JOURNAL_ENTRIES
    assert not {"FrameSearched", "ItemChanged"} & set(entries)


@pytest.mark.slow
@pytest.mark.parametrize("moving", [False, True], ids=["fixed", "moving"])
@pytest.mark.parametrize("overlapping", [False, True], ids=["disjoint", "overlapping"])
@pytest.mark.parametrize("count", [101, 300, 1000, 3000])
def test_the_run_ends_at_the_first_look(tmp_path: Path, count: int, overlapping: bool, moving: bool) -> None:
    crowd = {"count": count, "overlapping": overlapping, "moving": moving}
    assert_ended_as_crowded(*run_crowded(tmp_path, partial(_fake, crowd=crowd)), count)


def test_doubtful_boxes_count_as_well(tmp_path: Path) -> None:
    crowd = {"count": 300, "confidence": 0.3}
    assert_ended_as_crowded(*run_crowded(tmp_path, partial(_fake, crowd=crowd)), 300)


@pytest.mark.slow
@pytest.mark.parametrize("count", [300, 1000, 3000])
def test_the_run_ends_at_the_first_look_in_the_simulated_world(tmp_path: Path, count: int) -> None:
    kind = partial(SimCell, build_detectors=partial(_crowded, crowd={"count": count}))
    assert_ended_as_crowded(*run_crowded(tmp_path, kind), count)
