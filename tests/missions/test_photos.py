"""The way of `missions/photos.md`: from a labelled data set with names of its own to sorted objects."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from at_terminal import invoke

NAMES = {"bolt": "Hex Bolt", "nut": "nut-M8", "washer": "Washer"}
"""Names of the classes in the data set."""


def export(folder: Path, layout: str) -> None:
    """Write images of the cell `fasteners` as a data set whose classes have other names."""
    words = ("--images", "30", "--seed", "5", "--valid", "0.5", "--format", layout)
    assert invoke("dataset", "fasteners", "--out", str(folder), *words).exit_code == 0
    for file in [*folder.rglob("*.json"), *folder.rglob("*.yaml")]:
        text = file.read_text()
        for label, name in NAMES.items():
            text = re.sub(rf"\b{label}\b", name, text)
        file.write_text(text)


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
    export(tmp_path / "export", layout)
    trained = tmp_path / "cells" / "trained"
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
