"""The detector that comes with this project: a small RF-DETR trained on its own rendered scenes."""

from __future__ import annotations

from pathlib import Path

from executive.cell import Clock
from executive.cell_config import CameraConfig, DetectorConfig, Section
from executive.vision.detectors.onnx_model import OnnxModel, read_labels
from executive.vision.detectors.rfdetr import RfdetrDetector, read_options

WEIGHTS = Path(__file__).parent.parent / "weights"
MODEL = WEIGHTS / "embedded.onnx"
LABELS = WEIGHTS / "embedded.labels.txt"


class EmbeddedOptions(Section):
    """It needs nothing beyond what every detector has."""


class EmbeddedDetector(RfdetrDetector):
    """Finds cubes, spheres and ducks with the shipped weights; see `weights/embedded.card.md`."""

    @classmethod
    def from_config(
        cls, config: DetectorConfig, *, camera: CameraConfig, clock: Clock, base: Path
    ) -> EmbeddedDetector:
        """Return the detector; `base` plays no part, its weights are the project's own.

        Raises:
            InputError: An option was given: there are none.
        """
        del base
        read_options(EmbeddedOptions, config)
        return cls(OnnxModel(MODEL, read_labels(LABELS)), config, table_view=camera.table_view, clock=clock)
