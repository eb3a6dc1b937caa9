"""Shipped detector: a small RF-DETR that was trained on rendered scenes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.cell.config import DetectorConfig
from executive.perception.detectors.detector_registry import DetectorOptions, OptionErrors
from executive.perception.detectors.rfdetr import RfdetrDetector, RfdetrOptions

MODEL_PATH = Path(__file__).parent.parent / "weights" / "embedded.onnx"
"""Exported model with the shipped weights."""
LABELS_PATH = MODEL_PATH.with_suffix(".labels.txt")


class EmbeddedDetector(RfdetrDetector):
    """Detector of cubes, spheres and ducks with shipped weights (model card: `weights/embedded.card.md`)."""

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each option in the cell file with an error message: this kind of detector has no options."""
        del base, all_configs
        yield from DetectorOptions.find_errors(config)

    @staticmethod
    def _read_options(config: DetectorConfig) -> RfdetrOptions:
        del config
        return RfdetrOptions(model_path=str(MODEL_PATH), labels=str(LABELS_PATH))
