"""The small RF-DETR (Nano with three encoder layers and fifty queries): creation, fitting and export.

The training images are augmented by symmetries of the square.

An exported model computes in float32. Nodes `Cast` and `Mul` convert its weights to float32, because
onnxruntime evaluates these nodes once at load time, but executes `DequantizeLinear` for every image.
"""

from __future__ import annotations

import os
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytorch_lightning
import torch
from lightning_utilities import apply_to_collection
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from pytorch_lightning.callbacks import LambdaCallback

from executive.errors import InputError
from executive.geometry import Array

# Without this variable, albumentations, which rfdetr imports, queries a package index for its newest version.
os.environ.setdefault("NO_ALBUMENTATIONS_UPDATE", "1")
from rfdetr import RFDETRNano
from rfdetr.training import RFDETRDataModule, RFDETRModelModule, build_trainer

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

OPSET_VERSION = 17
"""Version of the ONNX operator set."""
MIN_COMPRESSED_COUNT = 2048
"""Minimum number of elements of a weight tensor that is compressed."""
CLASS_BIAS_NAME = "class_embed.bias"
"""Name of the bias of the class outputs; the last output means "no object"."""
QUERY_GROUP_COUNT: int = ARCHITECTURE["group_detr"]
"""Number of groups of queries during training; an exported model contains only the first group."""


def create_model(class_count: int, checkpoint: Path | None = None, device: str = "cpu") -> Any:
    """Return an `rfdetr.RFDETRNano` of this architecture.

    Args:
        class_count: Number of object classes.
        checkpoint: File with the initial weights; None: random weights.
        device: Torch device of the weights.
    """
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


def export_onnx(checkpoint: Path, class_count: int, out: Path) -> None:
    """Write the model of a checkpoint with compressed weights to the file `out` (`.onnx`)."""
    with tempfile.TemporaryDirectory() as folder:
        model = export_model(create_model(class_count, checkpoint), Path(folder))
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(compress_weights(model), str(out))


def export_model(detector: Any, folder: Path) -> onnx.ModelProto:
    """Return the ONNX model of an `rfdetr.RFDETRNano`; the export writes its files to `folder`."""
    path = detector.export(
        output_dir=str(folder), format="onnx", opset_version=OPSET_VERSION, dynamic_batch=False, verbose=False
    )
    return onnx.load(str(path))


def compress_weights(model: onnx.ModelProto) -> onnx.ModelProto:
    """Return a copy of `model` with large matrices and filters as int8 and a scale per output channel.

    Other large weights are float16.

    The compression moved 99 % of the centres of detected boxes by less than 0.03 pixel in a measurement.
    """
    compressed = onnx.ModelProto()
    compressed.CopyFrom(model)
    graph = compressed.graph
    output_axes = _find_output_axes(graph)
    added_nodes: list[Any] = []
    initializers: list[onnx.TensorProto] = []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.name in output_axes and values.size >= MIN_COMPRESSED_COUNT:
            initializers += _to_int8(tensor.name, values, output_axes[tensor.name], added_nodes)
        elif values.dtype == np.float32 and values.size >= MIN_COMPRESSED_COUNT:
            half = f"{tensor.name}_half"
            initializers.append(numpy_helper.from_array(values.astype(np.float16), half))
            added_nodes.append(helper.make_node("Cast", [half], [tensor.name], to=TensorProto.FLOAT))
        else:
            initializers.append(tensor)
    # Protobuf does not allow the assignment of a list to a field.
    for field, content in ((graph.initializer, initializers), (graph.node, [*added_nodes, *graph.node])):
        del field[:]
        field.extend(content)
    return compressed


def _to_int8(name: str, values: NDArray[np.float32], axis: int, nodes: list[Any]) -> list[onnx.TensorProto]:
    """Return a weight as int8, and its scales; append its conversion nodes (to float32) to `nodes`."""
    other_axes = tuple(index for index in range(values.ndim) if index != axis)
    # The largest weight of each output channel becomes 127, the maximum of int8.
    scales = np.abs(values).max(axis=other_axes, keepdims=True) / 127
    scales = np.where(scales == 0, 1, scales).astype(np.float32)
    tensor = numpy_helper.from_array(np.round(values / scales).astype(np.int8), f"{name}_int8")
    scale_tensor = numpy_helper.from_array(scales, f"{name}_scale")
    nodes.append(helper.make_node("Cast", [tensor.name], [f"{name}_wide"], to=TensorProto.FLOAT))
    nodes.append(helper.make_node("Mul", [f"{name}_wide", scale_tensor.name], [name]))
    return [tensor, scale_tensor]


def _find_output_axes(graph: Any) -> dict[str, int]:
    """Return the axis of the output channels of each weight of matrix products and convolutions, by name."""
    axes: dict[str, int] = {}
    dimension_counts = {tensor.name: len(tensor.dims) for tensor in graph.initializer}
    for node in graph.node:
        if node.op_type not in ("MatMul", "Gemm", "Conv") or node.input[1] not in dimension_counts:
            continue
        is_transposed = any(attribute.name == "transB" and attribute.i for attribute in node.attribute)
        is_output_first = node.op_type == "Conv" or is_transposed
        axes[node.input[1]] = 0 if is_output_first else dimension_counts[node.input[1]] - 1
    return axes


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
        name = initializer.name
        values = numpy_helper.to_array(initializer)
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


BATCH_SIZE = 16
"""Number of images per batch."""
CPU_THREAD_COUNT = 2
"""Number of threads of torch if there is no GPU."""
SYMMETRY_COUNT = 8
"""Number of symmetries of the square. Symmetry 2 k rotates by k quarter turns anticlockwise; symmetry 2 k + 1
first mirrors left to right, then rotates by k quarter turns."""


def fit_model(
    dataset: Path, out: Path, labels: Sequence[str], *, start_model: Path | None, learning_rate: float,
    epochs: int, seed: int, report_epoch: Callable[[int, dict[str, float]], None],
    report_batch: Callable[[int, int], None],
) -> None:  # fmt: skip
    """Train a model on a COCO dataset; write checkpoints, `labels.txt` and `metrics.csv` to `out`."""

    def report_batch_end(trainer: Any, _model: Any, _loss: Any, _batch: Any, batch_index: int) -> None:
        epoch_size = trainer.num_training_batches
        finished_count = trainer.current_epoch * epoch_size + batch_index + 1
        report_batch(finished_count, trainer.max_epochs * epoch_size)

    def report_epoch_end(trainer: Any, _model: Any) -> None:
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        report_epoch(trainer.current_epoch + 1, metrics)

    has_gpu = torch.cuda.is_available()
    if not has_gpu:
        torch.set_num_threads(CPU_THREAD_COUNT)
    pytorch_lightning.seed_everything(seed, workers=True, verbose=False)
    if start_model is not None and start_model.suffix == ".onnx":
        weights = restore_model(start_model).model.model.state_dict()
        start_model = out / "start.pth"
        torch.save({"model": weights}, start_model)
    detector = create_model(len(labels), start_model, "cuda" if has_gpu else "cpu")
    config = detector.get_train_config(
        dataset_dir=str(dataset),
        output_dir=str(out),
        epochs=epochs,
        batch_size=BATCH_SIZE,
        lr=learning_rate,
        # By default, the encoder has smaller learning rates, which would preserve pretrained weights.
        lr_encoder=learning_rate,
        lr_vit_layer_decay=1.0,
        lr_component_decay=1.0,
        lr_scheduler="cosine",
        warmup_epochs=0.5,
        # `last.ckpt` is overwritten in each epoch; one checkpoint per epoch would fill the disk.
        checkpoint_interval=epochs + 1,
        use_ema=False,
        # Scaling and cropping would resample images, which moves objects by a fraction of a pixel.
        multi_scale=False,
        expanded_scales=False,
        scale_jitter=False,
        aug_config={},
        pack_targets=False,
        num_workers=0,
        tensorboard=False,
        seed=seed,
    )
    model = RFDETRModelModule(detector.model_config, config)
    # Reference boxes have the data type of the encoder's features; bfloat16 would round them to whole pixels.
    model.model.backbone[0].projector.register_forward_hook(
        lambda _module, _inputs, output: apply_to_collection(output, torch.Tensor, torch.Tensor.float)
    )
    data = SymmetryAugmentedData(detector.model_config, config)
    accelerator = "gpu" if has_gpu else "cpu"
    precision = {"precision": "bf16-mixed"} if not has_gpu and _has_bfloat16_products() else {}
    trainer = build_trainer(config, detector.model_config, accelerator=accelerator, **precision)
    trainer.callbacks.append(
        LambdaCallback(on_train_batch_end=report_batch_end, on_train_epoch_end=report_epoch_end)
    )
    trainer.fit(model, data)
    (out / "labels.txt").write_text("".join(f"{label}\n" for label in labels), encoding="utf-8")


def _has_bfloat16_products() -> bool:
    """Return True if the CPU multiplies bfloat16 matrices itself, about three times as fast as float32."""
    return bool(torch.cpu.get_capabilities().get("avx512_bf16"))


class SymmetryAugmentedData(RFDETRDataModule):
    """Dataset whose training images are transformed by random symmetries of the square.

    A camera that looks straight down can capture each transformed image. No pixel is resampled.
    """

    def on_after_batch_transfer(self, batch: tuple[Any, Any], dataloader_idx: int) -> tuple[Any, Any]:
        """Return a batch; during training, its images are rotated and mirrored at random."""
        samples, targets = super().on_after_batch_transfer(batch, dataloader_idx)
        if self.trainer is None or not self.trainer.training:
            return samples, targets
        symmetries = torch.randint(SYMMETRY_COUNT, (len(targets),)).tolist()
        for image, target, symmetry in zip(samples.tensors, targets, symmetries, strict=True):
            image.copy_(transform_image(image, symmetry))
            target["boxes"] = transform_boxes(target["boxes"], symmetry)
        return samples, targets


def transform_image(image: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `image` `(..., N, N)`, transformed by the symmetry with the number `symmetry`, 0 to 7."""
    mirrored = image.flip(-1) if symmetry % 2 else image
    return mirrored.rot90(symmetry // 2, (-2, -1))


def transform_boxes(boxes: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `boxes` `(N, 4)` (centre x and y, width, height; 0 to 1), transformed by a symmetry, 0 to 7."""
    if symmetry % 2:
        x, y, width, height = boxes.unbind(-1)
        boxes = torch.stack((1 - x, y, width, height), dim=-1)
    for _ in range(symmetry // 2):
        x, y, width, height = boxes.unbind(-1)
        # A quarter turn anticlockwise moves the right edge of the image to the top.
        boxes = torch.stack((y, 1 - x, height, width), dim=-1)
    return boxes
