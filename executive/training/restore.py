"""Weights of an exported model, put back into a model that can be trained."""

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

CLASS_BIAS = "class_embed.bias"
"""Name of the bias with one element for each class and one for "no object"."""
GROUPS: int = ARCHITECTURE["group_detr"]
"""Number of groups of queries during training; an exported model contains the first one only."""


def restore(model: Path) -> Any:
    """Return an `rfdetr.RFDETRNano` with the weights of an exported model.

    The export renames some weights and drops others. To find the tensor of each exported weight, a model with
    random weights is exported and the values are compared. Each further group of queries becomes a copy of
    the first. Layers that the export drops, because no output depends on them, stay random.

    Args:
        model: ONNX file that `executive train` wrote.

    Raises:
        InputError: The file has another architecture.
    """
    stored = _read_weights(onnx.load(str(model)))
    # The last of the outputs stands for "no object".
    detector = create_model(len(stored.get(CLASS_BIAS, [0])) - 1)
    state = detector.model.model.state_dict()
    for tensor in state.values():
        if tensor.is_floating_point():
            tensor.normal_()
    with tempfile.TemporaryDirectory() as folder:
        exported = export_model(detector, Path(folder))
    for initializer in exported.graph.initializer:
        name, values = initializer.name, numpy_helper.to_array(initializer)
        if name not in stored or stored[name].shape != values.shape:
            raise InputError(
                f"{model} cannot be trained further: its weight {name} is missing or has another shape than "
                "in the architecture that `executive train` trains; start from a model that it made"
            )
        found = next((view for view in _candidate_tensors(state, name) if _is_equal(view, values)), None)
        # An initializer without a tensor is a constant of the graph.
        if found is not None:
            found.copy_(torch.from_numpy(stored[name]))
    _copy_groups(state)
    return detector


def _read_weights(model: onnx.ModelProto) -> dict[str, Array]:
    """Return the weights of a model by name, as float32 whatever they are stored as (see `compress`)."""
    tensors = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    weights = {}
    for name, values in tensors.items():
        if name.endswith("_int8"):
            name = name.removesuffix("_int8")
            values = values * tensors[f"{name}_scale"]
        weights[name.removesuffix("_half")] = values.astype(np.float32)
    return weights


def _candidate_tensors(state: dict[str, torch.Tensor], name: str) -> Iterator[torch.Tensor]:
    """Yield the parts of a model's weights that an export can contain under `name`."""
    if name in state:
        yield state[name]
        return
    for tensor in state.values():
        parts = [tensor]
        if tensor.ndim and len(tensor) % 3 == 0:  # the projections of queries, keys and values
            parts += tensor.chunk(3)
        if tensor.ndim and len(tensor) % GROUPS == 0:
            parts.append(tensor[: len(tensor) // GROUPS])
        for part in parts:
            yield part
            if part.ndim == 2:
                yield part.T
                yield part[None]


def _is_equal(view: torch.Tensor, values: Array) -> bool:
    return tuple(view.shape) == values.shape and bool(np.array_equal(view.numpy(), values))


def _copy_groups(state: dict[str, torch.Tensor]) -> None:
    """Make every group of queries, and the layers that propose its boxes, a copy of the first group."""
    for name, tensor in state.items():
        layer = re.fullmatch(r"(transformer\.enc_out\w+)\.0\.(.+)", name)
        if layer is not None:
            for group in range(1, GROUPS):
                state[f"{layer[1]}.{group}.{layer[2]}"].copy_(tensor)
        if name in ("refpoint_embed.weight", "query_feat.weight"):
            tensor.copy_(tensor[: len(tensor) // GROUPS].repeat(GROUPS, 1))
