"""Architecture of the small RF-DETR: the Nano model with three encoder layers and fifty queries."""

from __future__ import annotations

import functools
import importlib.util
import os
import warnings
from pathlib import Path
from typing import Any

RESOLUTION = 256
"""Side of the square input image [pixel]."""
ARCHITECTURE: dict[str, Any] = {
    "resolution": RESOLUTION,
    # The model uses the outputs of encoder layers 1 and 3; the export drops deeper layers.
    "out_feature_indexes": [1, 3],
    # At most 20 objects lie on the table; each of the 300 default queries would cost time in every step.
    "num_queries": 50,
    "num_select": 50,
    "group_detr": 5,
    "dec_layers": 2,
}
"""Arguments of `RFDETRNano` that differ from its defaults."""

TORCHVISION_OPERATORS = ("nms", "qnms")
"""Operators that torchvision's Python part needs at import; the training calls none of them."""


def create_model(class_count: int, checkpoint: Path | None = None, device: str = "cpu") -> Any:
    """Return an `rfdetr.RFDETRNano` of this architecture.

    Args:
        class_count: Number of object classes.
        checkpoint: File with the initial weights; None: random weights.
        device: Torch device of the weights.
    """
    # Without this variable, albumentations queries a package index for its newest version at import.
    os.environ.setdefault("NO_ALBUMENTATIONS_UPDATE", "1")
    declare_missing_operators()
    from rfdetr import RFDETRNano

    with warnings.catch_warnings():
        # RF-DETR warns that training from random weights needs more data than fine-tuning.
        warnings.simplefilter("ignore")
        return RFDETRNano(
            # For a name without a folder, rfdetr would search its own downloads.
            pretrain_weights=None if checkpoint is None else str(checkpoint.resolve()),
            num_classes=class_count,
            device=device,
            **ARCHITECTURE,
        )


def describe_architecture() -> dict[str, str]:
    """Return the architecture and the input as texts by name, for a model card."""
    return {
        "architecture": "RF-DETR Nano (rfdetr), "
        + ", ".join(f"{name} {value}" for name, value in ARCHITECTURE.items()),
        "input": f"{RESOLUTION} x {RESOLUTION} pixel, RGB",
    }


@functools.cache
def declare_missing_operators() -> object | None:
    """Declare torchvision's operators if its compiled part does not load; to call before its import.

    With a CPU build of torch and the default build of torchvision, the compiled part of torchvision does not
    load, and its Python part raises an error at the missing operators.

    Returns:
        The library that keeps the declarations alive, or None.
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
