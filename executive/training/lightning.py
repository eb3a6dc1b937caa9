"""What we change in RF-DETR's own training loop: symmetries as augmentation, fast arithmetic on CPUs."""

from __future__ import annotations

from typing import Any

import torch
from rfdetr.training import RFDETRDataModule, RFDETRModelModule
from torch.nn.attention import SDPBackend, sdpa_kernel

from executive.training.symmetry import ELEMENTS, transform_boxes, transform_image


class SymmetricData(RFDETRDataModule):
    """The data set, every training image shown under a random symmetry of the square.

    The cameras look straight down, so each of the eight is a view that could have been; no pixel is
    resampled, so the boxes stay exact.
    """

    def on_after_batch_transfer(self, batch: tuple[Any, Any], dataloader_idx: int) -> tuple[Any, Any]:
        """Return the batch, its images turned and mirrored while training."""
        samples, targets = super().on_after_batch_transfer(batch, dataloader_idx)
        if self.trainer is None or not self.trainer.training:
            return samples, targets
        elements = torch.randint(ELEMENTS, (len(targets),)).tolist()
        for image, target, element in zip(samples.tensors, targets, elements, strict=True):
            image.copy_(transform_image(image, element))
            target["boxes"] = transform_boxes(target["boxes"], element)
        return samples, targets


class Model(RFDETRModelModule):
    """RF-DETR's training module, in mixed precision on CPUs too.

    Matrix products in bfloat16 are two and a half times as fast on CPUs that have them. Losses, matching
    and reference boxes stay in float32: with eight bits of mantissa a box would sit on a raster of a pixel.
    """

    def __init__(self, model_config: Any, train_config: Any, reduced: bool) -> None:
        super().__init__(model_config, train_config)
        self._reduced = reduced
        # The decoder's reference boxes take the number type of the encoder's features.
        self.model.backbone[0].projector.register_forward_hook(
            lambda _module, _inputs, output: in_float32(output)
        )

    def training_step(self, batch: tuple[Any, Any], batch_idx: int) -> Any:
        """Return the loss of one batch."""
        if not self._reduced:
            return super().training_step(batch, batch_idx)
        samples, targets = batch
        # The fused attention kernel's backward pass is slower in bfloat16 than the plain products.
        with torch.autocast("cpu", torch.bfloat16), sdpa_kernel(SDPBackend.MATH):
            outputs = self.model(samples, targets)
        losses = self.criterion(in_float32(outputs), targets)
        weights = self.criterion.weight_dict
        loss = torch.stack([losses[name] * weights[name] for name in losses if name in weights]).sum()
        self.log("train/loss", loss, on_epoch=True, on_step=False, batch_size=len(targets))
        return loss


def in_float32(value: Any) -> Any:
    """Return `value`, a tensor or nested lists and mappings of them, its floating tensors in float32."""
    if isinstance(value, torch.Tensor):
        return value.float() if value.is_floating_point() else value
    if isinstance(value, dict):
        return {key: in_float32(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(in_float32(item) for item in value)
    return value
