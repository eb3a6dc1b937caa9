"""The shipped weights: small enough to ship, and as good as their card says, on scenes drawn afresh."""

from __future__ import annotations

import pytest

from executive.mission.parse.cell_file import load_cell
from executive.sim.scenes import SceneRenderer
from executive.vision.detectors.embedded import LABELS, MODEL, WEIGHTS
from executive.vision.evaluation.asking import CellDetector
from executive.vision.evaluation.evaluate import evaluate
from executive.vision.samples import LabelledImage

SCENES = range(1000, 1020)
"""Seeds that no training image was drawn from."""


def test_the_weights_fit_into_a_package_and_a_card_goes_with_them():
    assert MODEL.stat().st_size < 20_000_000
    assert LABELS.read_text().split() == ["cube", "sphere", "duck"]
    assert "## Measured" in (WEIGHTS / "embedded.card.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["overhead", pytest.param("wrist", marks=pytest.mark.slow)])
def test_fresh_scenes_of_a_shipped_cell_are_read_almost_without_error(missions, name):
    config = load_cell(missions / "cells" / f"{name}.yaml")
    renderer = SceneRenderer(config, next(iter(config.cameras)))
    samples = []
    for seed in SCENES:
        drawn = renderer.sample(seed)
        boxes, ignored = (tuple(map(tuple, found.tolist())) for found in (drawn.boxes, drawn.ignored))
        truth = {
            "part": drawn.part,
            "matrix": drawn.matrix.tolist(),
            "X_WC": drawn.X_WC.rounded(9),
            "positions": drawn.positions.tolist(),
        }
        samples.append(LabelledImage(str(seed), drawn.image, drawn.labels, boxes, ignored, truth))
    renderer.close()
    detector = CellDetector(config.detectors, "embedded", base=missions)
    measured = evaluate(detector, samples)
    detector.close()
    assert measured.objects > 20
    # Of about fifty objects: the card's figures, less two mistakes.
    assert measured.precision >= 0.95
    assert measured.recall >= 0.90
    assert measured.centre.median < 1.0
    assert measured.position.median < 3.0
