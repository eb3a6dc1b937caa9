"""The shipped weights: small enough to ship, and as good as their cards say, on scenes drawn afresh."""

from __future__ import annotations

from executive.mission.cell_file import load_cell
from executive.perception.detectors.rfdetr import LABELS_PATH, MODEL_PATH, read_labels


def test_the_weights_fit_into_a_package_and_a_card_goes_with_them(missions):
    fasteners = missions / "cells" / "fasteners"
    for cell, model, labels, card in (
        ("overhead", MODEL_PATH, LABELS_PATH, MODEL_PATH.with_suffix(".card.md")),
        ("fasteners", fasteners / "model.onnx", fasteners / "labels.txt", fasteners / "card.md"),
    ):
        assert model.stat().st_size < 20_000_000
        assert "## Measured" in card.read_text(encoding="utf-8")
        assert set(read_labels(labels)) == set(load_cell(missions / "cells" / f"{cell}.yaml").objects)
