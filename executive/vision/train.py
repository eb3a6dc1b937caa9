"""Train the small RF-DETR on a COCO or YOLO folder, from random weights or from a checkpoint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from executive.errors import InputError

Progress = Callable[[int, dict[str, float]], None]


def train(
    dataset: Path,
    out: Path,
    *,
    start: Path | None = None,
    epochs: int = 20,
    seed: int = 0,
    progress: Progress = lambda _epoch, _metrics: None,
) -> None:
    """Leave `out/checkpoint_best_total.pth`, `out/labels.txt` and `out/metrics.csv` behind.

    Args:
        dataset: Folder as Roboflow exports it: `train/` and `valid/`, each with `_annotations.coco.json`, or
            a `data.yaml` for YOLO.
        out: Folder for checkpoints, one an epoch, and figures; made if missing.
        start: Checkpoint to fine-tune; None trains from random weights.
        epochs: Number of passes over the data.
        seed: Seed of weights, order and augmentation.
        progress: Called after every epoch with its number, from 1, and its figures.

    Raises:
        InputError: The folder is no data set, or the training packages are not installed.

    """
    _check(dataset, start)
    try:
        from executive.vision.training.torchvision_ops import declare_missing

        declare_missing()
        from executive.vision.training.run import fit
    except ImportError as error:
        raise InputError(
            f'training needs the package "{error.name}"; install the extra: uv sync --extra train'
        ) from error
    out.mkdir(parents=True, exist_ok=True)
    fit(dataset, out, start=start, epochs=epochs, seed=seed, progress=progress)


def _check(dataset: Path, start: Path | None) -> None:
    if start is not None and not start.is_file():
        raise InputError(f"there is no checkpoint {start} to start from; train one first, or leave it out")
    coco = [dataset / part / "_annotations.coco.json" for part in ("train", "valid")]
    yolo = [dataset / name for name in ("data.yaml", "data.yml")]
    if not (all(path.is_file() for path in coco) or any(path.is_file() for path in yolo)):
        raise InputError(
            f"{dataset} is not a data set: it needs train/_annotations.coco.json and "
            "valid/_annotations.coco.json (COCO), or data.yaml (YOLO); a Roboflow export has one of them"
        )
