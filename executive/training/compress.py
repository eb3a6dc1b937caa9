"""Export of a checkpoint to an ONNX file whose weights are stored in fewer bits.

The arithmetic stays in float32. The file widens the weights by `Cast` (and `Mul`), which onnxruntime folds
into plain weights at load time; onnxruntime would execute `DequantizeLinear` again for every image.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from executive.training.architecture import create

OPSET = 17
"""Version of the ONNX operators."""
MIN_COMPRESSED_SIZE = 2048
"""Smallest number of values of a weight that is compressed."""


def export_onnx(checkpoint: Path, classes: int, out: Path) -> None:
    """Write the model of a checkpoint with compressed weights to `out` (`.onnx`)."""
    with tempfile.TemporaryDirectory() as folder:
        model = export(create(classes, checkpoint), Path(folder))
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(compress(model), str(out))


def export(detector: Any, folder: Path) -> onnx.ModelProto:
    """Return the ONNX model of an `rfdetr.RFDETRNano`; the export leaves its files in `folder`."""
    path = detector.export(
        output_dir=str(folder), format="onnx", opset_version=OPSET, dynamic_batch=False, verbose=False
    )
    return onnx.load(str(path))


def compress(model: onnx.ModelProto) -> onnx.ModelProto:
    """Return a copy of `model` whose large weights are stored as int8, with one scale per output channel.

    Weights that are not matrices or filters become float16. Measured: 99 % of the box centres move by less
    than 0.03 pixel against float32.
    """
    small = onnx.ModelProto()
    small.CopyFrom(model)
    graph = small.graph
    channels = _output_axes(graph)
    widening: list[Any] = []
    kept: list[onnx.TensorProto] = []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.data_type != TensorProto.FLOAT or values.size < MIN_COMPRESSED_SIZE:
            kept.append(tensor)
        elif tensor.name in channels:
            kept += _store_int8(tensor.name, values, channels[tensor.name], widening)
        else:
            kept += _store_half(tensor.name, values, widening)
    _replace(graph.initializer, kept)
    _replace(graph.node, [*widening, *graph.node])
    return small


def _store_half(name: str, values: NDArray[np.float32], widening: list[Any]) -> list[onnx.TensorProto]:
    stored = numpy_helper.from_array(values.astype(np.float16), f"{name}_half")
    widening.append(helper.make_node("Cast", [stored.name], [name], to=TensorProto.FLOAT))
    return [stored]


def _store_int8(
    name: str, values: NDArray[np.float32], axis: int, widening: list[Any]
) -> list[onnx.TensorProto]:
    others = tuple(i for i in range(values.ndim) if i != axis)
    scale = np.abs(values).max(axis=others, keepdims=True) / 127
    scale = np.where(scale == 0, 1, scale).astype(np.float32)
    stored = numpy_helper.from_array(np.round(values / scale).astype(np.int8), f"{name}_int8")
    scales = numpy_helper.from_array(scale, f"{name}_scale")
    widening.append(helper.make_node("Cast", [stored.name], [f"{name}_wide"], to=TensorProto.FLOAT))
    widening.append(helper.make_node("Mul", [f"{name}_wide", scales.name], [name]))
    return [stored, scales]


def _output_axes(graph: Any) -> dict[str, int]:
    """Return the axis of the output channel of every weight of a matrix product or convolution."""
    axes: dict[str, int] = {}
    names = {tensor.name: len(tensor.dims) for tensor in graph.initializer}
    for node in graph.node:
        if node.op_type not in ("MatMul", "Gemm", "Conv") or node.input[1] not in names:
            continue
        transposed = any(attribute.name == "transB" and attribute.i for attribute in node.attribute)
        rows_first = node.op_type == "Conv" or transposed
        axes[node.input[1]] = 0 if rows_first else names[node.input[1]] - 1
    return axes


def _replace(field: Any, values: list[Any]) -> None:
    del field[:]
    field.extend(values)
