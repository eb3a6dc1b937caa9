"""Evaluation of detectors on labelled images, rendered or from a dataset."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.layout import build_object_class
from executive.cell.protocols import Localizer
from executive.cells.sim.scene_file import load_scene
from executive.cells.sim.spawn import find_max_object_count
from executive.errors import InputError, explain_os_errors
from executive.mission.findings import list_choices
from executive.perception.detectors.detector_registry import find_detector_problems
from executive.perception.envelope.fingerprint import compute_fingerprint
from executive.perception.envelope.measurement import (
    MEASUREMENT_SUFFIX,
    ErrorCounts,
    Measurement,
    format_measurements,
    read_measurements,
)
from executive.perception.localization import build_localizer
from executive.record.atomic_file import write_atomically
from executive.training.evaluation.cell_detector import CellDetector
from executive.training.evaluation.evaluate import (
    MIN_CONFIDENCE,
    MODEL_NAME,
    evaluate,
    find_label_file,
    make_model_config,
)
from executive.training.evaluation.metrics import NO_OBJECT, Evaluation
from executive.training.evaluation.worst_mistakes import WorstMistakes
from executive.training.labelled_image import LabelledImage
from executive.training.rendering import generate_dataset, render_run_frames
from executive.training.samples import Samples

MAX_OBJECT_COUNT = 20
"""Maximum number of objects in a rendered scene; fewer if the table has no room for them."""
OpenProgressBar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]
"""Function that opens a progress bar with a name; the context manager yields `update(done, total)`."""


@dataclass(frozen=True)
class SceneSettings:
    """Settings for rendered scenes.

    Attributes:
        image_count: Number of images per cell.
        seed: Random seed.
        is_varied: True: scenes vary as in training. False: initial scenes of runs with at most
            `MAX_OBJECT_COUNT` objects; the detector searches the same region as in a run.
        view: Region of the frame that is searched: `table`, or `full` for the whole frame.
        workers: Number of processes that render.
        scene: Scene file that changes the initial scenes of runs; None: no change.
    """

    image_count: int
    seed: int
    is_varied: bool
    view: str
    workers: int
    scene: Path | None = None


@dataclass(frozen=True, eq=False)
class DetectorUnderTest:
    """A detector to measure.

    Attributes:
        cell: Cell of the detector; None: a detector without a cell.
        configs: Configuration of the detector, and of other detectors that it may use, by name.
        name: Key of the detector in `configs`.
        base: Folder to which paths in the options of the detector are relative.
    """

    cell: CellConfig | None
    configs: dict[str, DetectorConfig]
    name: str
    base: Path

    def make_measurement_name(self, dataset: Path | None) -> str:
        """Return the name of a measurement on a dataset, or on scenes of the cell if `dataset` is None."""
        if dataset is None:
            assert self.cell is not None
            return self.cell.cell
        return f"{self.cell.cell} on {dataset}" if self.cell else str(dataset)


def list_detectors(
    cells: Mapping[Path, CellConfig], detector: str | None, weights: Path | None, labels: Path | None
) -> Iterator[DetectorUnderTest]:
    """Yield the detectors to measure: one per cell, or one without a cell.

    Args:
        cells: Cells by the path of the cell file.
        detector: Name of the detector in each cell; None: the first detector of the cell.
        weights: Model file to measure instead of the detectors of the cells; None: no model file.
        labels: File with the class names of the model; None: the file in the folder of the model.

    Raises:
        InputError: A cell has no detector of this name.
    """
    model_configs: dict[str, DetectorConfig] = {}
    if weights is not None:
        model_configs = {MODEL_NAME: make_model_config(weights, labels or find_label_file(weights))}
    elif not cells:
        model_configs = {"embedded": DetectorConfig(kind="embedded", floor=MIN_CONFIDENCE)}
    if not cells:
        yield DetectorUnderTest(None, model_configs, next(iter(model_configs)), Path())
    for file, config in cells.items():
        configs = model_configs or dict(config.detectors)
        name = detector or next(iter(configs))
        if name not in configs:
            hint = list_choices(name, configs, "Its detectors")
            raise InputError(f'the cell {config.cell} has no detector "{name}". {hint}')
        yield DetectorUnderTest(config, configs, name, file.parent)


def check_detector(detector: DetectorUnderTest, *, renders_scenes: bool, scene: Path | None = None) -> None:
    """Check that scenes can be rendered and the detector can be built, before minutes of rendering.

    Raises:
        InputError: The cell is not simulated, the scene file has errors, or a detector cannot be built.
    """
    cell = detector.cell
    if renders_scenes and cell and cell.kind != "sim":
        raise InputError(
            f"scenes can be rendered only of cells of kind sim, but {cell.cell} is of kind {cell.kind}; "
            "measure its detector on your own images with --dataset"
        )
    if renders_scenes and cell:
        load_scene(scene, cell)
    for (_, name, *_), sentence in find_detector_problems(detector.configs, detector.base):
        raise InputError(f"detector {name}: {sentence}")


def measure_detector(
    detector: DetectorUnderTest,
    dataset: Path | None,
    scenes: SceneSettings,
    *,
    threshold: float | None,
    worst_mistakes: WorstMistakes,
    progress: OpenProgressBar,
) -> Evaluation:
    """Evaluate a detector on `dataset` or on rendered scenes of its cell; add to `worst_mistakes`."""
    config = detector.cell
    run_config = None if dataset is not None or scenes.is_varied else config
    with _open_images(detector, dataset, scenes, progress) as samples:
        cell_detector = CellDetector(
            detector.configs,
            detector.name,
            base=detector.base,
            camera=next(iter(run_config.cameras.values())) if run_config else None,
            view=scenes.view,
            classes=tuple(config.objects) if config else None,
        )
        with contextlib.closing(cell_detector), progress(f"running {detector.name}") as update:
            return evaluate(
                cell_detector, _show_progress(samples, update), threshold=threshold, worst=worst_mistakes,
                localizer=_build_localizer(run_config) if run_config else None,
                table=run_config.table if run_config else None,
            )  # fmt: skip


@contextlib.contextmanager
def _open_images(
    detector: DetectorUnderTest, dataset: Path | None, scenes: SceneSettings, progress: OpenProgressBar
) -> Iterator[Samples | list[LabelledImage]]:
    """Open the images of the dataset, or render scenes of the cell; a context manager."""
    config = detector.cell
    if dataset is not None or config is None:
        assert dataset is not None
        yield Samples(dataset)
    elif scenes.is_varied:
        with tempfile.TemporaryDirectory() as folder:
            with progress(f"rendering {config.cell}") as update:
                generate_dataset(
                    {config.cell: config}, Path(folder), images=scenes.image_count, seed=scenes.seed,
                    layout="coco", workers=scenes.workers, valid_fraction=1.0, progress=update,
                )  # fmt: skip
            yield Samples(Path(folder))
    else:
        table = {"objects": (0, find_max_object_count(config, MAX_OBJECT_COUNT))}
        limited_config = config.model_copy(update={"table": config.table.model_copy(update=table)})
        with progress(f"rendering {config.cell}") as update:
            frames = render_run_frames(
                limited_config, images=scenes.image_count, seed=scenes.seed, workers=scenes.workers,
                progress=update, scene=load_scene(scenes.scene, config),
            )  # fmt: skip
        yield frames


def _show_progress(
    samples: Samples | list[LabelledImage], update_progress: Callable[[int, int], None]
) -> Iterator[LabelledImage]:
    """Yield the images; update the progress bar after each image."""
    for done, sample in enumerate(samples, 1):
        yield sample
        update_progress(done, len(samples))


def _build_localizer(config: CellConfig) -> Localizer | None:
    """Return the localizer of the cell; None for the method `ray`, which needs a simulated world."""
    if config.localization == "ray":
        return None
    classes = {label: build_object_class(label, kind) for label, kind in config.objects.items()}
    return build_localizer(config.localization, classes)


def store_evaluation(
    detector: DetectorUnderTest, evaluation: Evaluation, out: Path | None, *, command: str, seconds: float
) -> Path:
    """Write the measured errors of a detector to a file and return the path of the file.

    Measurements of other detectors in the file are not changed.

    Args:
        detector: The detector and its cell.
        evaluation: Measured errors of the detector.
        out: The file; None: `CELL.measured.json` in the folder of the cell file.
        command: Command line that repeats the evaluation.
        seconds: Duration of the evaluation [s].

    Raises:
        InputError: The detector gave no usable answer to any image, or the file cannot be read or written.
    """
    assert detector.cell is not None
    path = out or detector.base / f"{detector.cell.cell}{MEASUREMENT_SUFFIX}"
    if evaluation.reliability is None:
        raise InputError(
            f"detector {detector.name} gave no usable answer: {evaluation.why}; nothing was measured"
        )
    confusion_matrix = evaluation.confusion
    measurement = Measurement(
        detector=detector.name,
        fingerprint=dict(compute_fingerprint(detector.cell, detector.name, detector.base)),
        command=command,
        seconds=round(seconds, 1),
        images=evaluation.images,
        rates=evaluation.reliability.rates,
        classes={
            label: ErrorCounts(
                objects=sum(row.values()),
                missed=row.get(NO_OBJECT, 0),
                confused=sum(row.values()) - row.get(NO_OBJECT, 0) - row.get(label, 0),
                false_detections=confusion_matrix.get(NO_OBJECT, {}).get(label, 0),
            )
            for label, row in confusion_matrix.items()
            if label != NO_OBJECT
        },
        counts={
            str(count): ErrorCounts(**{name: errors.get(name, 0) for name in ErrorCounts.model_fields})
            for count, errors in sorted(evaluation.by_count.items())
        },
        frames=evaluation.frames,
    )
    advice = "name another file with --out, and copy it into the folder of your cell file"
    with explain_os_errors(InputError, f"the measurement {path} cannot be written", advice):
        write_atomically(path, format_measurements(read_measurements(path), measurement))
    return path
