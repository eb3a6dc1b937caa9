"""A cell's detector on scenes as a run begins with, one property of the scene changed at a time."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import yaml

from executive.campaign.evaluation import ImageSettings, check_detector, list_detectors, measure_detector
from executive.cell.config import CellConfig
from executive.cli.shared import show_progress
from executive.text.files import find_cell
from executive.training.metrics import NO_OBJECT, Evaluation
from tests.benchmarks.outside_the_envelope import SCENES
from tests.benchmarks.report import Figures, run_command, write_json

THRESHOLD = 0.5
"""Confidence from which a detection counts."""
MAX_WRONG_CLASS_SHARE = 0.015
"""Limit of the share of the objects that are found as another class."""
MIN_RECALL = 0.92
"""Limit of the share of the objects that are found as what they are."""
MIN_OBJECTS = 400
"""Number of objects per variant below which the figures say too little."""


def measure(
    cell: CellConfig, images: int = 100, seed: int = 0, workers: int = 2, out: Path = Path("variants.json")
) -> Figures:
    """Measure the first detector of CELL on changed scenes.

    A problem is a variant with more than 1.5 % wrong classes or a recall below 0.92, or too few objects.
    """
    rows: list[Figures] = []
    details: Figures = {}
    (detector,) = list_detectors({find_cell(cell.cell): cell}, None, None, None)
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in list_variants(cell).items():
            path = Path(folder) / "scene.yaml"
            path.write_text(yaml.safe_dump({"scene": name, **scene}), encoding="utf-8")
            settings = ImageSettings(None, images, seed, False, "table", workers, path, THRESHOLD)
            check_detector(detector, settings)
            evaluation = measure_detector(detector, settings, [], show_progress)
            rows.append(describe_evaluation(name, evaluation))
            details[name] = {"scene": scene, **rows[-1], **evaluation.to_dict()}
    figures = {
        "cell": cell.cell,
        "seed": seed,
        "images": images,
        "variants": rows,
        "problems": [f"{row['variant']}: {row['limits']}" for row in rows if row["limits"]],
    }
    write_json(out, {**figures, "details": details})
    return figures


def list_variants(cell: CellConfig) -> dict[str, dict[str, Any]]:
    """Return the scenes that fit the camera of a cell by name."""
    camera = next(iter(cell.cameras.values()))
    if camera.mount != "fixed" or camera.position is None:
        return SCENES["variants"]
    scenes = {}
    for name, scene in SCENES["fixed_camera_variants"].items():
        scenes[name] = scene
        if "raised" in scene:
            scenes[name] = {"camera": {"shift": [0.0, 0.0, round(scene["raised"] * camera.position[2], 4)]}}
    return {**SCENES["variants"], **scenes}


def describe_evaluation(name: str, evaluation: Evaluation) -> Figures:
    """Return the row of a variant; `limits` names the limits that it exceeds."""
    confusion = evaluation.confusion
    wrong = sum(
        count
        for true, row in confusion.items()
        for found, count in row.items()
        if NO_OBJECT not in (true, found) and true != found
    )
    share = wrong / max(evaluation.objects, 1)
    exceeded = {
        "wrong classes": share > MAX_WRONG_CLASS_SHARE,
        "recall": evaluation.recall < MIN_RECALL,
        "too few objects": evaluation.objects < MIN_OBJECTS,
    }
    return {
        "variant": name,
        "objects": evaluation.objects,
        "precision": evaluation.precision,
        "recall": evaluation.recall,
        "wrong class %": 100 * share,
        "missed": sum(row.get(NO_OBJECT, 0) for true, row in confusion.items() if true != NO_OBJECT),
        "invented": sum(confusion.get(NO_OBJECT, {}).values()),
        "limits": ", ".join(limit for limit, is_exceeded in exceeded.items() if is_exceeded),
    }


if __name__ == "__main__":
    run_command(measure)
