"""The detector that comes with this project: a small RF-DETR trained on its own rendered scenes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from executive.cell import Clock
from executive.cell_config import CameraConfig, DetectorConfig, Section
from executive.vision.detectors.onnx_model import OnnxModel, read_labels
from executive.vision.detectors.options import read_options, wrong_options
from executive.vision.detectors.rfdetr import RfdetrDetector

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

    @staticmethod
    def check(config: DetectorConfig, base: Path) -> Iterator[tuple[str, str]]:
        """Yield every option that was given, with a sentence: there are none."""
        del base
        yield from wrong_options(EmbeddedOptions, config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the classes that the shipped weights were trained on."""
        del config, base
        return read_labels(LABELS)
