"""From an exported ONNX file back to a checkpoint that training can start from.

An export renames and turns weights. Which became which is found by exporting a model of the same
architecture whose weights are all different, and looking where each of its values went.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
from numpy.typing import NDArray

from executive.errors import InputError
from executive.vision.training.architecture import ARCHITECTURE, create
from executive.vision.training.compress import widened
from executive.vision.training.export import export

Array = NDArray[np.float32]
Lookup = Callable[[Array], Array | None]
"""From a weight of the probe to the exported weight in its place, or None."""


def recover(exported: Path, out: Path) -> None:
    """Write to `out` (`.pth`) the checkpoint that the ONNX file `exported` was made from, all it still holds.

    What an export leaves out keeps random weights: the encoder's unused layers. Groups of queries that
    only training knows start as copies of the first.

    Raises:
        InputError: The file is of another architecture.
    """
    try:
        model = onnx.load(str(exported))
    except DecodeError:
        raise InputError(f"{exported} is no ONNX file") from None
    detector = create(_classes(model))
    network = detector.model.model
    state = {name: value.clone() for name, value in network.state_dict().items()}
    _make_all_different(network)
    with tempfile.TemporaryDirectory() as folder:
        probe = widened(export(detector, Path(folder)))
    stored = widened(model)
    if any(name not in stored or stored[name].shape != value.shape for name, value in probe.items()):
        raise InputError(
            f"{exported} is of another architecture than the small RF-DETR trained here; start from a model "
            "of this one, or from random weights"
        )
    lookup = _lookup(probe, stored)
    for name, value in network.state_dict().items():
        found = _found(value.numpy(), lookup)
        if found is not None:
            state[name] = torch.from_numpy(found.copy())
    for name in state:
        first = re.sub(r"(transformer\.enc_\w+)\.\d+\.", r"\1.0.", name)
        state[name] = state[first].clone()
    queries = {name: ARCHITECTURE[name] for name in ("num_queries", "group_detr")}
    torch.save({"model": state, "args": queries}, out)


def _classes(model: onnx.ModelProto) -> int:
    """Return how many classes an exported model tells apart; its last output has one more, for nothing."""
    shape = model.graph.output[-1].type.tensor_type.shape.dim
    return max(1, shape[-1].dim_value - 1) if shape else 1


def _make_all_different(network: Any) -> None:
    """Give every weight a value of its own: an export keeps one copy of what is equal."""
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.copy_(torch.randn(weight.shape, generator=generator) * 0.02)


def _lookup(probe: dict[str, Array], stored: dict[str, Array]) -> Lookup:
    names = {np.ascontiguousarray(value).tobytes(): name for name, value in probe.items()}

    def lookup(value: Array) -> Array | None:
        name = names.get(np.ascontiguousarray(value).tobytes())
        if name is not None:
            return stored[name].reshape(value.shape)
        name = names.get(np.ascontiguousarray(value.T).tobytes())
        return None if name is None else np.ascontiguousarray(stored[name].T)

    return lookup


def _found(value: Array, lookup: Lookup) -> Array | None:
    """Return the exported weight of a probe's `value`, put together where the export took it apart."""
    whole = lookup(value)
    if whole is not None or value.ndim == 0:
        return whole
    # Attention projects to queries, keys and values with one matrix, an export with three.
    q, k, v = (lookup(part) for part in np.array_split(value, 3))
    if q is not None and k is not None and v is not None:
        return np.concatenate([q, k, v])
    # Training has several groups of object queries, an export the first.
    first = lookup(value[: ARCHITECTURE["num_queries"]])
    return None if first is None else np.concatenate([first] * ARCHITECTURE["group_detr"])
