"""Restoration of a trainable model from the weights of an exported model."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from executive.errors import InputError
from executive.geometry import Array
from executive.training.architecture import ARCHITECTURE, create_model
from executive.training.compress import export_model

CLASS_BIAS_NAME = "class_embed.bias"
"""Name of the bias of the class outputs; the last output means "no object"."""
QUERY_GROUP_COUNT: int = ARCHITECTURE["group_detr"]
"""Number of groups of queries during training; an exported model contains only the first group."""


def restore_model(model: Path) -> Any:
    """Return an `rfdetr.RFDETRNano` with the weights of an ONNX file that `executive train` wrote.

    The export renames and drops weights. To find the original names, a model with random weights is exported,
    and each exported weight is compared with the tensors of the model. All groups of queries become copies of
    the first group. Layers that the export drops, because no output depends on them, stay random.

    Raises:
        InputError: The file has another architecture.
    """
    stored_weights = _read_weights(onnx.load(str(model)))
    detector = create_model(len(stored_weights.get(CLASS_BIAS_NAME, [0])) - 1)
    weights_by_name = detector.model.model.state_dict()
    # Random values distinguish tensors that RF-DETR initializes with equal constants.
    for tensor in weights_by_name.values():
        if tensor.is_floating_point():
            tensor.normal_()
    with tempfile.TemporaryDirectory() as folder:
        exported = export_model(detector, Path(folder))
    for initializer in exported.graph.initializer:
        name, values = initializer.name, numpy_helper.to_array(initializer)
        if name not in stored_weights or stored_weights[name].shape != values.shape:
            raise InputError(
                f"{model} cannot be trained further: its weight {name} is missing or has another shape than "
                "in the architecture that `executive train` trains; start from a model of `executive train`"
            )
        candidates = _find_candidate_tensors(weights_by_name, name)
        matching_view = next((view for view in candidates if np.array_equal(view.numpy(), values)), None)
        # An initializer without a matching tensor is a constant of the graph.
        if matching_view is not None:
            matching_view.copy_(torch.from_numpy(stored_weights[name]))
    _copy_query_groups(weights_by_name)
    return detector


def _read_weights(model: onnx.ModelProto) -> dict[str, Array]:
    """Return the weights of a model by name, converted from int8 and float16 to float32."""
    tensors = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    weights = {}
    for name, values in tensors.items():
        if name.endswith("_int8"):
            name = name.removesuffix("_int8")
            values = values * tensors[f"{name}_scale"]
        weights[name.removesuffix("_half")] = values.astype(np.float32)
    return weights


def _find_candidate_tensors(weights_by_name: dict[str, torch.Tensor], name: str) -> Iterator[torch.Tensor]:
    """Yield the tensors of a model, and parts of tensors, that an export may contain under `name`."""
    if name in weights_by_name:
        yield weights_by_name[name]
        return
    for tensor in weights_by_name.values():
        views = [tensor]
        # The export splits the projections of queries, keys and values, and transposes matrices.
        if tensor.ndim and len(tensor) % 3 == 0:
            views += tensor.chunk(3)
        if tensor.ndim and len(tensor) % QUERY_GROUP_COUNT == 0:
            views.append(tensor[: len(tensor) // QUERY_GROUP_COUNT])
        for view in views:
            yield view
            if view.ndim == 2:
                yield view.T
                yield view[None]


def _copy_query_groups(weights_by_name: dict[str, torch.Tensor]) -> None:
    """Copy the first group of queries, and the layers that propose its boxes, to every other group."""
    for name, tensor in weights_by_name.items():
        # The number in `transformer.enc_out_….0.…` is the index of the group.
        if layer := re.fullmatch(r"(transformer\.enc_out\w+)\.0\.(.+)", name):
            for group in range(1, QUERY_GROUP_COUNT):
                weights_by_name[f"{layer[1]}.{group}.{layer[2]}"].copy_(tensor)
        if name in ("refpoint_embed.weight", "query_feat.weight"):
            tensor.copy_(tensor[: len(tensor) // QUERY_GROUP_COUNT].repeat(QUERY_GROUP_COUNT, 1))
