"""The fasteners' weights: small enough to ship, and as good as their card says, on scenes drawn afresh."""

from __future__ import annotations

from pathlib import Path

from executive.mission.parse.cell_file import load_cell
from executive.sim.scenes import SceneRenderer
from executive.vision.detectors.onnx_model import OnnxModel, read_labels

SCENES = range(2000, 2008)
"""Seeds that no training image was drawn from."""


def test_the_weights_fit_into_a_package_and_a_card_goes_with_them(missions: Path) -> None:
    folder = missions / "cells" / "fasteners"
    assert (folder / "model.onnx").stat().st_size < 20_000_000
    assert "## Measured" in (folder / "card.md").read_text(encoding="utf-8")
    objects = load_cell(missions / "cells" / "fasteners.yaml").objects
    assert read_labels(folder / "labels.txt") == tuple(objects)


def test_fresh_scenes_are_read_almost_without_error(missions: Path) -> None:
    folder = missions / "cells" / "fasteners"
    model = OnnxModel(folder / "model.onnx", read_labels(folder / "labels.txt"), 2)
    renderer = SceneRenderer(load_cell(missions / "cells" / "fasteners.yaml"), "overhead", randomized=False)
    missed = objects = 0
    for seed in SCENES:
        sample = renderer.sample(seed)
        found = sorted(detection.label for detection in model.detect(sample.image, 0.5))
        objects += len(sample.labels)
        missed += len(sample.labels) - len(found)
        assert set(found) <= set(sample.labels)
    renderer.close()
    assert objects > 35
    assert 0 <= missed <= 2
