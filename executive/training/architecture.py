"""Architecture of the small RF-DETR: the Nano model with three encoder layers and fifty queries."""

from __future__ import annotations

import functools
import importlib.util
import os
import warnings
from pathlib import Path
from typing import Any

# Without this variable, albumentations, which rfdetr imports, queries a package index for its newest version.
os.environ.setdefault("NO_ALBUMENTATIONS_UPDATE", "1")

RESOLUTION = 256
"""Side of the square input image [pixel]."""
ARCHITECTURE: dict[str, Any] = {
    "resolution": RESOLUTION,
    # The model uses the outputs of encoder layers 1 and 3; the export drops deeper layers.
    "out_feature_indexes": [1, 3],
    # At most 20 objects lie on the table; the default, 300 queries, would make training and inference slower.
    "num_queries": 50,
    "num_select": 50,
    "group_detr": 5,
    "dec_layers": 2,
}
"""Arguments of `RFDETRNano` that differ from its defaults."""

TORCHVISION_OPERATORS = ("nms", "qnms")
"""Operators that the import of torchvision needs; the training calls none of them."""


def create_model(class_count: int, checkpoint: Path | None = None, device: str = "cpu") -> Any:
    """Return an `rfdetr.RFDETRNano` of this architecture.

    Args:
        class_count: Number of object classes.
        checkpoint: File with the initial weights; None: random weights.
        device: Torch device of the weights.
    """
    declare_missing_operators()
    from rfdetr import RFDETRNano

    with warnings.catch_warnings():
        # RF-DETR warns that training from random weights needs more data than fine-tuning.
        warnings.simplefilter("ignore")
        # For a name without a folder, rfdetr would search its own downloads.
        weights = None if checkpoint is None else str(checkpoint.resolve())
        return RFDETRNano(pretrain_weights=weights, num_classes=class_count, device=device, **ARCHITECTURE)


def describe_architecture() -> dict[str, str]:
    """Return the descriptions of architecture and input for a model card, by name."""
    arguments = ", ".join(f"{name} {value}" for name, value in ARCHITECTURE.items())
    model_input = f"{RESOLUTION} x {RESOLUTION} pixel, RGB"
    return {"architecture": f"RF-DETR Nano (rfdetr), {arguments}", "input": model_input}


@functools.cache
def declare_missing_operators() -> object | None:
    """Declare the operators of torchvision if its compiled library cannot be loaded; return the declarations.

    A CPU build of torch cannot load the compiled library of the default build of torchvision. The import of
    torchvision then fails without declared operators. The cache keeps the declarations alive.
    """
    import torch

    spec = importlib.util.find_spec("torchvision")
    if spec is None or spec.origin is None:
        return None
    try:
        torch.ops.load_library(str(next(Path(spec.origin).parent.glob("_C*"))))
    except (OSError, ImportError, StopIteration):
        library = torch.library.Library("torchvision", "DEF")
        for name in TORCHVISION_OPERATORS:
            library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        return library
    return None
