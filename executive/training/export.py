"""From a checkpoint to the ONNX file a detector runs."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import onnx

from executive.training.architecture import create
from executive.training.compress import compress

OPSET = 17


def export_onnx(checkpoint: Path, classes: int, out: Path) -> None:
    """Write a checkpoint's model to `out` (`.onnx`), one image at a time, its weights compressed."""
    with tempfile.TemporaryDirectory() as folder:
        model = export(create(classes, checkpoint), Path(folder))
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(compress(model), str(out))


def export(detector: Any, folder: Path) -> onnx.ModelProto:
    """Return the ONNX model of an `rfdetr.RFDETRNano`; files are left in `folder`."""
    path = detector.export(
        output_dir=str(folder), format="onnx", opset_version=OPSET, dynamic_batch=False, verbose=False
    )
    return onnx.load(str(path))
