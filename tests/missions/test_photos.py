"""The way of `missions/photos.md`: from a labelled data set with names of its own to sorted objects."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from at_terminal import invoke

from executive.mission.cell_file import load_cell
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.rendering import render_run_frames

NAMES = {"bolt": "Hex Bolt", "nut": "nut-M8", "washer": "Washer"}
"""Names of the classes in the data set."""


def export(missions: Path, folder: Path, layout: str) -> None:
    """Write photos of the table of the cell `fasteners`, whose classes have other names."""
    cell = load_cell(missions / "cells" / "fasteners.yaml")
    left, top, right, bottom = next(iter(cell.cameras.values())).table_view
    entries = []
    for index, one in enumerate(
        render_run_frames(cell, image_count=60, seed=5, worker_count=1, progress=lambda _done, _all: None)
    ):
        photo = one.image[top:bottom, left:right]
        file = f"{index}.png"
        save_image(build_image_path(folder, layout, "valid", file), photo)
        boxes = tuple((x - left, y - top, right_x - left, low - top) for x, y, right_x, low in one.boxes)
        labels = tuple(NAMES[label] for label in one.labels)
        entries.append(DatasetEntry("valid", file, (photo.shape[1], photo.shape[0]), labels, boxes))
    write_annotations(folder, layout, entries, [*NAMES.values()])


def read_example(missions: Path, head: str) -> str:
    """Return the YAML example of the guide that begins with `head`."""
    blocks = re.findall(r"```yaml\n(.*?)```", (missions / "photos.md").read_text(), re.DOTALL)
    return next(block for block in blocks if block.startswith(head))


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["coco", "yolo"])
def test_a_data_set_of_others_becomes_a_mission(
    missions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, layout: str
) -> None:
    monkeypatch.chdir(tmp_path)
    export(missions, tmp_path / "export", layout)
    folder = re.search(r"--out (\S+)", (missions / "photos.md").read_text())
    assert folder is not None
    trained = tmp_path / folder[1]
    trained.mkdir(parents=True)
    # A training takes too long here; this model knows the same objects.
    shutil.copy(missions / "cells" / "fasteners" / "model.onnx", trained)
    (trained / "labels.txt").write_text("Hex Bolt\nnut-M8\nWasher\n")
    cell = read_example(missions, "base: cells/fasteners.yaml")
    Path("cells/photos.yaml").write_text(cell.replace("Bolt (short): bolt, ", ""))
    Path("sort_photos.yaml").write_text(read_example(missions, "mission: sort_photos"))
    measured = invoke("evaluate", "--cell", "cells/photos.yaml", "--dataset", "export", "--force", "--json")
    assert measured.exit_code == 0, measured.output
    (checked,) = json.loads(invoke("check", "sort_photos.yaml", "--json").stdout)
    assert checked["findings"] == []
    done = invoke("run", "sort_photos.yaml", "--set", "cell.table.objects=[2, 2]", "--seed", "3", "--json")
    result = json.loads(done.stdout)
    assert (result["status"], result["audit"]["right"]) == ("SUCCESS", 2), result["message"]
