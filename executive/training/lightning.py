"""Extensions of RF-DETR's PyTorch Lightning modules: augmentation by symmetries, mixed precision on CPUs."""

from __future__ import annotations

from typing import Any

import torch
from lightning_utilities import apply_to_collection
from rfdetr.training import RFDETRDataModule, RFDETRModelModule
from torch.nn.attention import SDPBackend, sdpa_kernel

SYMMETRY_COUNT = 8
"""Number of symmetries of the square. Symmetry 2 k rotates by k quarter turns anticlockwise; symmetry 2 k + 1
first mirrors left to right, then rotates by k quarter turns."""


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


class MixedPrecisionModel(RFDETRModelModule):
    """RF-DETR's training module with mixed precision on CPUs.

    On CPUs with bfloat16, matrix products are 2.5 times as fast as in float32. Losses, matching and reference
    boxes stay in float32, because the mantissa of bfloat16, eight bits, would round boxes to whole pixels.

    Args:
        model_config: RF-DETR's configuration of the model.
        train_config: RF-DETR's configuration of the training.
        is_mixed: True to train in mixed precision on the CPU, False for the training step of RF-DETR.
    """

    def __init__(self, model_config: Any, train_config: Any, is_mixed: bool) -> None:
        super().__init__(model_config, train_config)
        self._is_mixed = is_mixed
        # Reference boxes have the data type of the encoder's features, and must stay in float32.
        projector = self.model.backbone[0].projector
        projector.register_forward_hook(lambda _module, _inputs, output: to_float32(output))

    def training_step(self, batch: tuple[Any, Any], batch_idx: int) -> Any:
        """Return the loss of a batch."""
        if not self._is_mixed:
            return super().training_step(batch, batch_idx)
        samples, targets = batch
        # In bfloat16, the backward pass of the fused attention kernel is slower than plain matrix products.
        with torch.autocast("cpu", torch.bfloat16), sdpa_kernel(SDPBackend.MATH):
            outputs = self.model(samples, targets)
        losses = self.criterion(to_float32(outputs), targets)
        weights = self.criterion.weight_dict
        loss = torch.stack([losses[name] * weights[name] for name in losses if name in weights]).sum()
        self.log("train/loss", loss, on_epoch=True, on_step=False, batch_size=len(targets))
        return loss


def transform_image(image: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `image` `(..., N, N)`, transformed by the symmetry with the number `symmetry`, 0 to 7."""
    mirrored = image.flip(-1) if symmetry % 2 else image
    return mirrored.rot90(symmetry // 2, (-2, -1))


def transform_boxes(boxes: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Return `boxes` `(N, 4)` (centre x and y, width, height; 0 to 1), transformed by a symmetry, 0 to 7."""
    x, y, width, height = boxes.unbind(-1)
    if symmetry % 2:
        x = 1 - x
    for _ in range(symmetry // 2):
        # A quarter turn anticlockwise moves the right edge of the image to the top.
        x, y, width, height = y, 1 - x, height, width
    return torch.stack((x, y, width, height), dim=-1)


def to_float32(value: Any) -> Any:
    """Return a tensor, or a nested list or mapping of tensors, with all floating-point tensors as float32."""
    return apply_to_collection(
        value, torch.Tensor, lambda tensor: tensor.float() if tensor.is_floating_point() else tensor
    )
