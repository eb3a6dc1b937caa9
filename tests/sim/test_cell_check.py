"""What a simulated cell says about a cell file before anything moves, and what a checker learns from it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from executive.cell_config import CellConfig
from executive.mission.parse.cell_file import load_cell
from executive.sim.cell import SimCell


@pytest.fixture
def overhead(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "overhead.yaml")


@pytest.mark.parametrize("name", ["overhead", "wrist", "depth"])
def test_nothing_is_wrong_with_a_shipped_cell(missions: Path, name: str) -> None:
    path = missions / "cells" / f"{name}.yaml"
    assert list(SimCell.check(load_cell(path), path.parent)) == []


def test_all_that_is_wrong_is_said_at_once(overhead: CellConfig, tmp_path: Path) -> None:
    far = overhead.bins["red_bin"].model_copy(update={"position": (1.5, 0.0, 0.0)})
    yolo = overhead.detectors["embedded"].model_copy(update={"kind": "yolo"})
    poses = {**overhead.arm.poses_deg, "down": (0, 118, 0, 0, 0, 0, 0), "turned": (0, 0, 0, 0, 0, 0, 180)}
    config = overhead.model_copy(
        update={
            "arm": overhead.arm.model_copy(update={"poses_deg": poses}),
            "bins": {"red_bin": far},
            "detectors": {"yolo": yolo},
            "localization": "depth",
        }
    )
    found = dict(SimCell.check(config, tmp_path))
    assert list(found) == [
        ("localization",),
        ("detectors", "yolo", "kind"),
        ("arm", "poses_deg", "turned"),
        ("bins", "red_bin", "position"),
        ("arm", "poses_deg", "down"),
    ]
    assert found["localization",] == (
        'localization "depth" needs a camera with depth, and overhead has none; give it a section '
        '"depth: {}", or use "plane"'
    )


def test_the_labels_are_those_of_its_detectors(overhead: CellConfig, tmp_path: Path) -> None:
    own = {"model_path": "own.onnx", "labels": ["red", "blue"], "class_map": {"red": "cube"}}
    detectors = {
        **overhead.detectors,
        "own": overhead.detectors["embedded"].model_validate({"kind": "rfdetr", **own}),
        "yolo": overhead.detectors["embedded"].model_copy(update={"kind": "yolo"}),
    }
    labels = SimCell.labels(overhead.model_copy(update={"detectors": detectors}), tmp_path)
    assert set(labels["embedded"] or ()) == {"cube", "sphere", "duck"}
    assert labels["own"] == ("cube", "blue")
    assert labels["yolo"] is None


def test_a_check_loads_no_model_and_none_of_what_runs_one(missions: Path) -> None:
    """onnxruntime alone takes a tenth of a second and 40 MB."""
    program = (
        "import sys; from pathlib import Path; from executive.mission.parse.cell_file import load_cell; "
        "from executive.sim.cell import SimCell; path = Path(sys.argv[1]); config = load_cell(path); "
        "SimCell.check(config, path.parent); SimCell.labels(config, path.parent); "
        "SimCell.least_times(config).carry(None); "
        "loaded = {'onnxruntime', 'PIL', 'supervision', 'rich', 'torch'} & set(sys.modules); "
        # What pybullet prints on stdout may come out after everything else.
        "print('loaded:', *sorted(loaded), file=sys.stderr)"
    )
    arguments = [sys.executable, "-c", program, str(missions / "cells" / "overhead.yaml")]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "loaded:"
