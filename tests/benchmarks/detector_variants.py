"""A cell's detector on scenes as a run begins with, one property of the scene changed at a time."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import click
import yaml

from executive.campaign.evaluation import ImageSettings, check_detector, list_detectors, measure_detector
from executive.cell.config import CellConfig
from executive.cli.cells import find_cell, load_cells
from executive.cli.options import seed_option, workers_option
from executive.cli.progress import show_progress
from executive.training.evaluation.metrics import NO_OBJECT, Evaluation
from executive.training.evaluation.worst_mistakes import WorstMistakes
from tests.benchmarks.report import Figures, run_command, write_json
from tests.benchmarks.scenes_outside import Scene

THRESHOLD = 0.5
"""Confidence from which a detection counts."""
MAX_WRONG_CLASS_SHARE = 0.015
"""Limit of the share of the objects that are found as another class."""
MIN_RECALL = 0.92
"""Limit of the share of the objects that are found as what they are."""
MIN_OBJECTS = 400
"""Number of objects per variant below which the figures say too little."""
PURPLE, TEAL, SAND = [0.48, 0.22, 0.62], [0.12, 0.55, 0.52], [0.66, 0.52, 0.36]
"""Colours of objects that no cell file declares: r, g, b, each 0 to 1."""

VARIANTS: Mapping[str, Scene] = {
    "declared": {},
    "field of view +12 %": {"camera": {"fov_factor": 1.12}},
    "field of view -12 %": {"camera": {"fov_factor": 0.88}},
    "field of view +22 %": {"camera": {"fov_factor": 1.22}},
    "objects nearly black": {"objects": {"any": {"colours": [[0.07, 0.065, 0.06]]}}},
    "objects dark": {
        "objects": {"any": {"colours": [[0.17, 0.08, 0.06], [0.07, 0.13, 0.09], [0.08, 0.09, 0.19]]}}
    },
    "objects purple and teal": {"objects": {"any": {"colours": [PURPLE, TEAL]}}},
    "objects of the table's colour": {"objects": {"any": {"colours": [SAND]}}},
    "table dark": {"table": {"colour": [0.24, 0.23, 0.22]}},
    "table blue": {"table": {"texture": "plain", "colour": [0.24, 0.36, 0.66]}},
    "table green": {"table": {"texture": "plain", "colour": [0.28, 0.52, 0.33]}},
    "table grey": {"table": {"texture": "plain", "colour": [0.47, 0.48, 0.49]}},
    "table tiled": {"table": {"texture": "pattern 18", "colour": [0.82, 0.8, 0.78]}},
    "brightness 0.17": {"light": {"brightness": 0.17}},
    "brightness 0.34": {"light": {"brightness": 0.34}},
    "brightness 1.55": {"light": {"brightness": 1.55}},
    "lamp orange": {"light": {"colour": [1.0, 0.78, 0.55]}},
    "lamp low, with shadow": {"light": {"direction": [1.4, 0.9, 0.7], "shadow": True}},
    "noise of the gain 0.16": {"camera": {"noise": {"gain": 0.16}}},
    "noise of a pixel 14": {"camera": {"noise": {"read": 14.0}}},
    "cubes 0.82": {"objects": {"cube": {"scale": 0.82}}},
    "spheres 1.27": {"objects": {"sphere": {"scale": 1.27}}},
    "crowded, touching": {"table": {"gap": 0.0, "objects": [8, 10]}},
}
"""Scenes for any camera by name."""

FIXED_CAMERA_VARIANTS: Mapping[str, tuple[float, Scene]] = {
    "height +12 %": (0.12, {}),
    "height +24 %": (0.24, {}),
    "tilted by 13 deg": (0.0, {"camera": {"orbit_deg": [9.2, 9.2, 0.0]}}),
}
"""Scenes for a fixed camera alone by name: relative change of its height over the table, and the others."""


def measure(name_of_cell: str, images: int, seed: int, workers: int, out: Path) -> Figures:
    """Measure the first detector of a cell on changed scenes.

    A problem is a variant with more than 1.5 % wrong classes or a recall below 0.92, or too few objects.
    """
    file, (cell,) = find_cell(name_of_cell), load_cells((name_of_cell,)).values()
    rows: list[Figures] = []
    details: Figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in list_variants(cell).items():
            path = Path(folder) / "scene.yaml"
            path.write_text(yaml.safe_dump({"scene": name, **scene}), encoding="utf-8")
            evaluation = evaluate_scene(file, cell, images, seed, workers, path)
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


def list_variants(cell: CellConfig) -> dict[str, Scene]:
    """Return the scenes that fit the camera of a cell by name."""
    camera = next(iter(cell.cameras.values()))
    listed = dict(VARIANTS)
    if camera.mount == "fixed" and camera.position is not None:
        for name, (change, scene) in FIXED_CAMERA_VARIANTS.items():
            shift = [0.0, 0.0, round(change * camera.position[2], 4)]
            listed[name] = {"camera": {"shift": shift}} if change else scene
    return listed


def evaluate_scene(
    file: Path, cell: CellConfig, images: int, seed: int, workers: int, scene: Path
) -> Evaluation:
    """Return the figures of the first detector of a cell in a scene, as `executive evaluate` does."""
    (detector,) = list_detectors({file: cell}, None, None, None)
    settings = ImageSettings(None, images, seed, False, "table", workers, scene, THRESHOLD)
    check_detector(detector, settings)
    return measure_detector(detector, settings, WorstMistakes(), show_progress)


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
        "wrong class": wrong,
        "missed": sum(row.get(NO_OBJECT, 0) for true, row in confusion.items() if true != NO_OBJECT),
        "invented": sum(confusion.get(NO_OBJECT, {}).values()),
        "limits": ", ".join(limit for limit, is_exceeded in exceeded.items() if is_exceeded),
    }


if __name__ == "__main__":
    run_command(
        measure,
        click.option("--cell", "name_of_cell", default="overhead", show_default=True, help="Cell."),
        click.option(
            "--images", type=click.IntRange(min=1), default=100, show_default=True,
            help="Images per variant; 100 of the cell overhead show about 450 objects.",
        ),
        seed_option,
        workers_option,
        click.option(
            "--out", type=click.Path(path_type=Path, dir_okay=False), default="detector_variants.json",
            show_default=True, help="JSON file of all figures.",
        ),
    )  # fmt: skip
