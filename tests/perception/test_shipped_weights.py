"""The shipped weights: small enough to ship, and as good as their cards say, on scenes drawn afresh."""

from __future__ import annotations

import pytest

from executive.cells.sim.scene_file import DECLARED_SCENE
from executive.mission.parse.cell_file import load_cell
from executive.perception.detectors.embedded import LABELS_PATH, MODEL_PATH
from executive.perception.detectors.onnx_model import read_labels
from executive.training.evaluation.evaluate import CellDetector, evaluate
from executive.training.rendering import SceneRenderer


def test_the_weights_fit_into_a_package_and_a_card_goes_with_them(missions):
    fasteners = missions / "cells" / "fasteners"
    for cell, model, labels, card in (
        ("overhead", MODEL_PATH, LABELS_PATH, MODEL_PATH.with_suffix(".card.md")),
        ("fasteners", fasteners / "model.onnx", fasteners / "labels.txt", fasteners / "card.md"),
    ):
        assert model.stat().st_size < 20_000_000
        assert "## Measured" in card.read_text(encoding="utf-8")
        assert set(read_labels(labels)) == set(load_cell(missions / "cells" / f"{cell}.yaml").objects)


@pytest.mark.slow
# Seeds that no training image was drawn from; the cards' figures, less two mistakes.
@pytest.mark.parametrize(
    ("name", "scenes", "randomized", "precision", "recall"),
    [
        ("overhead", range(1000, 1020), True, 0.90, 0.80),
        ("wrist", range(1000, 1020), True, 0.90, 0.80),
        ("fasteners", range(2000, 2008), False, 0.95, 0.94),
    ],
)
def test_fresh_scenes_of_a_shipped_cell_are_read_almost_without_error(
    missions, name, scenes, randomized, precision, recall
):
    config = load_cell(missions / "cells" / f"{name}.yaml")
    renderer = SceneRenderer(config, None if randomized else DECLARED_SCENE)
    images = [renderer.render_image(seed, seed) for seed in scenes]
    renderer.close()
    camera = None if randomized else next(iter(config.cameras.values()))
    detectors, base = config.detectors, missions / "cells"
    detector = CellDetector(detectors, next(iter(detectors)), base=base, camera=camera)
    measured = evaluate(detector, images)
    detector.close()
    assert measured.objects > 20
    assert (measured.precision >= precision, measured.recall >= recall) == (True, True)
    assert (measured.centre.median < 1.0, measured.position.median < 3.0) == (True, True)
