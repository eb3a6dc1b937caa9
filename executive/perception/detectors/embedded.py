"""Shipped detector: a small RF-DETR that was trained on rendered scenes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.cell.config import DetectorConfig
from executive.perception.detectors.onnx_model import OnnxModel, read_labels
from executive.perception.detectors.options import DetectorOptions, OptionErrors
from executive.perception.detectors.requests import DetectorContext
from executive.perception.detectors.rfdetr import RfdetrDetector

MODEL_PATH = Path(__file__).parent.parent / "weights" / "embedded.onnx"
"""Exported model with the shipped weights."""
LABELS_PATH = MODEL_PATH.with_suffix(".labels.txt")


class EmbeddedDetector(RfdetrDetector):
    """Detector of cubes, spheres and ducks with shipped weights (model card: `weights/embedded.card.md`)."""

    @classmethod
    def from_config(cls, config: DetectorConfig, context: DetectorContext) -> EmbeddedDetector:
        """Return the detector with the shipped weights.

        Raises:
            InputError: The cell file has an option; this kind of detector has no options.
        """
        DetectorOptions.read(config)
        return cls(OnnxModel.load(MODEL_PATH, read_labels(LABELS_PATH)), config, context)

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each option in the cell file with an error message: this kind of detector has no options."""
        del base, all_configs
        yield from DetectorOptions.find_errors(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the classes on which the shipped model was trained."""
        del config, base
        return read_labels(LABELS_PATH)

    @staticmethod
    def weights(config: DetectorConfig, base: Path) -> Path | None:
        """Return the path of the shipped model."""
        del config, base
        return MODEL_PATH
