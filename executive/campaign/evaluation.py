"""Evaluation of detectors on labelled images, rendered or from a dataset; its text, tables and file."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import astuple, dataclass
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Column, Table

from executive.cell.config import CellConfig, DetectorConfig
from executive.drivers.sim.scene import load_scene
from executive.drivers.sim.spawn import find_max_object_count
from executive.errors import InputError, explain_os_errors
from executive.mission.cell_file import load_cell
from executive.perception.detectors import envelope
from executive.perception.detectors.detector_registry import find_detectable_labels, find_detector_errors
from executive.perception.localization import CellLocalizer
from executive.record.run_directory import write_atomically
from executive.text.files import find_cell
from executive.text.findings import suggest_choice
from executive.training import evaluate
from executive.training.dataset import LabelledImage
from executive.training.evaluate import EvaluatedDetector, Mistake
from executive.training.metrics import NO_OBJECT, Evaluation
from executive.training.rendering import generate_dataset, render_run_frames
from executive.training.samples import LabelledDataset

MAX_OBJECT_COUNT = 20
"""Maximum number of objects in a rendered scene; fewer if the table has no room for them."""
MIN_OBJECT_COUNT = 30
"""Minimum number of objects of each class in a measurement that runs may use."""
MIN_ACCURACY = 0.5
"""Minimum precision and recall in a measurement that runs may use."""
OpenProgressBar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]
"""Function that opens a progress bar with a name; the context manager yields `update(done, total)`."""
Images = LabelledDataset | list[LabelledImage]
"""Labelled images of a dataset, or of rendered scenes."""


def load_cells(
    paths_or_names: tuple[str, ...], overrides: Mapping[str, str] | None = None
) -> dict[Path, CellConfig]:
    """Return the configurations of cells by the path of the cell file.

    `paths_or_names` contains paths of cell files and names of shipped cells. `overrides` contains values for
    keys of the cells, by key name `cell.KEY.KEY`.

    Raises:
        InputError: A cell does not exist, two cells have the same name, or a file is invalid.
    """
    cells: dict[Path, CellConfig] = {}
    for path in dict.fromkeys(map(find_cell, paths_or_names)):
        config = load_cell(path, overrides)
        if any(config.cell == other.cell for other in cells.values()):
            raise InputError(f'two cells are called "{config.cell}"; give one of them another name')
        cells[path] = config
    return cells


@dataclass(frozen=True)
class ImageSettings:
    """Settings for the images on which detectors are measured, and for the detections.

    Attributes:
        dataset: Labelled images; None: rendered scenes of the cell.
        image_count: Number of rendered images per cell.
        seed: Random seed.
        is_randomized: True for scenes with domain randomization; False for the initial scenes of runs.
        view: Region of interest in images of initial scenes of runs: `table`, or `full` for the whole image.
        workers: Number of rendering processes.
        scene: Scene file that changes the initial scenes of runs; None: no change.
        threshold: Minimum confidence of a detection; None: the threshold of the detector.
    """

    dataset: LabelledDataset | None
    image_count: int
    seed: int
    is_randomized: bool
    view: str
    workers: int
    scene: Path | None = None
    threshold: float | None = None


@dataclass(frozen=True, eq=False)
class DetectorUnderTest:
    """A detector whose accuracy is measured.

    Attributes:
        cell: Cell of the detector; None: a detector without a cell.
        configs: Configurations of the detector and of the detectors that it may use, by name.
        name: Name of the detector, a key of `configs`.
        base_folder: Folder to which paths in the options of the detector are relative.
    """

    cell: CellConfig | None
    configs: dict[str, DetectorConfig]
    name: str
    base_folder: Path


def list_detectors(
    cells: Mapping[Path, CellConfig], name: str | None, model_file: Path | None, label_file: Path | None
) -> Iterator[DetectorUnderTest]:
    """Yield the detectors to measure: one per cell, or one without a cell.

    Args:
        cells: Cells by the path of the cell file.
        name: Name of the detector in each cell; None: the first detector of the cell.
        model_file: Model that is measured instead of the detectors of the cells; None: no model.
        label_file: File with the class names of the model; None: the file in the folder of the model.

    Raises:
        InputError: A cell has no detector of this name.
    """
    fixed_configs: dict[str, DetectorConfig] = {}
    if model_file is not None:
        label_file = label_file or evaluate.find_label_file(model_file)
        fixed_configs = {evaluate.MODEL_NAME: evaluate.make_model_config(model_file, label_file)}
    elif not cells:
        fixed_configs = {"embedded": DetectorConfig(kind="embedded", floor=evaluate.MIN_CONFIDENCE)}
    if not cells:
        yield DetectorUnderTest(None, fixed_configs, next(iter(fixed_configs)), Path())
    for cell_file, cell in cells.items():
        configs = fixed_configs or dict(cell.detectors)
        if name and name not in configs:
            hint = suggest_choice(name, configs, "Its detectors")
            raise InputError(f'the cell {cell.cell} has no detector "{name}". {hint}')
        yield DetectorUnderTest(cell, configs, name or next(iter(configs)), cell_file.parent)


def check_detector(detector: DetectorUnderTest, settings: ImageSettings) -> None:
    """Check that necessary scenes of the cell can be rendered and that the detector can be built.

    Raises:
        InputError: The cell is not simulated, the scene file has errors, or a detector cannot be built.
    """
    cell = detector.cell
    if settings.dataset is None and cell:
        if cell.kind != "sim":
            problem = f"but {cell.cell} is of kind {cell.kind}"
            advice = "measure its detector on your own images with --dataset"
            raise InputError(f"scenes can be rendered only of cells of kind sim, {problem}; {advice}")
        load_scene(settings.scene, cell)
    for key_path, problem in find_detector_errors(detector.configs, detector.base_folder):
        raise InputError(f"detector {key_path[1]}: {problem}")


def measure_detector(
    detector: DetectorUnderTest, settings: ImageSettings, mistakes: list[Mistake], progress: OpenProgressBar
) -> Evaluation:
    """Evaluate a detector on a dataset, or on rendered scenes of its cell; update the worst mistakes."""
    # Images of a dataset and of randomized scenes do not use the camera, table and localizer of the cell.
    cell_of_images = None if settings.dataset is not None or settings.is_randomized else detector.cell
    camera = next(iter(cell_of_images.cameras.values())) if cell_of_images else None
    classes = tuple(detector.cell.objects) if detector.cell else None
    localizer = None
    # The method `ray` needs a simulated world.
    if cell_of_images and cell_of_images.localization != "ray":
        localizer = CellLocalizer(cell_of_images.localization, cell_of_images.build_classes())
    name = detector.name
    if settings.dataset is not None:
        known_classes = classes or find_detectable_labels(detector.configs, detector.base_folder)[name] or ()
        class_map = (detector.configs[name].model_extra or {}).get("class_map", {})
        settings.dataset.match_classes(known_classes, f"detector {name}", class_map)
    images: Images | None = settings.dataset
    if images is None:
        assert detector.cell is not None
        images = _render_images(detector.cell, settings, progress)
    evaluated_detector = EvaluatedDetector(
        detector.configs, name, base=detector.base_folder, camera=camera, view=settings.view, classes=classes
    )
    with contextlib.closing(evaluated_detector), progress(f"running {name}") as update:
        return evaluate.evaluate(
            evaluated_detector, _iterate_with_progress(images, update), mistakes=mistakes,
            localizer=localizer, cell=cell_of_images, threshold=settings.threshold,
        )  # fmt: skip


def _render_images(
    cell: CellConfig, settings: ImageSettings, progress: OpenProgressBar
) -> list[LabelledImage]:
    """Return rendered scenes of the cell."""
    with progress(f"rendering {cell.cell}") as update:
        if settings.is_randomized:
            with tempfile.TemporaryDirectory() as folder:
                generate_dataset(
                    [cell], Path(folder), image_count=settings.image_count, seed=settings.seed,
                    layout="coco", worker_count=settings.workers, valid_fraction=1.0, progress=update,
                )  # fmt: skip
                return list(LabelledDataset(Path(folder)))
        object_counts = (0, find_max_object_count(cell, MAX_OBJECT_COUNT))
        table = cell.table.model_copy(update={"objects": object_counts})
        return render_run_frames(
            cell.model_copy(update={"table": table}), image_count=settings.image_count,
            seed=settings.seed, worker_count=settings.workers, progress=update,
            scene=load_scene(settings.scene, cell),
        )  # fmt: skip


def _iterate_with_progress(images: Images, update: Callable[[int, int], None]) -> Iterator[LabelledImage]:
    """Yield the images; update the progress bar after each image."""
    for image_count, image in enumerate(images, 1):
        yield image
        update(image_count, len(images))


def find_weakness(detector: DetectorUnderTest, evaluation: Evaluation) -> str:
    """Return the reason why a measurement predicts runs badly; "" if there is none.

    A precision or recall near zero is usually an error in the labels, not in the detector.
    """
    assert detector.cell is not None
    if evaluation.reliability is None:
        return f"no usable answer: {evaluation.why}"
    counts = {label: 0 for label, section in detector.cell.objects.items() if not section.looks_like}
    counts |= {label: metrics.objects for label, metrics in evaluation.by_class.items()}
    problems = [f"{count} {label} objects" for label, count in counts.items() if count < MIN_OBJECT_COUNT]
    for name, metrics in {"all classes": evaluation, **evaluation.by_class}.items():
        if min(metrics.precision, metrics.recall) < MIN_ACCURACY:
            problems.append(f"precision {metrics.precision:.2f}, recall {metrics.recall:.2f} of {name}")
    return ", ".join(problems)


def store_evaluation(
    detector: DetectorUnderTest, evaluation: Evaluation, out: Path | None, *, command: str, duration: float
) -> Path:
    """Add or replace the measured errors of a detector in a file, and return the path of the file.

    Args:
        detector: The detector and its cell.
        evaluation: Measured errors of the detector.
        out: The file; None: `CELL.measured.json` in the folder of the cell file.
        command: Command line that repeats the evaluation.
        duration: Duration of the evaluation [s].

    Raises:
        InputError: The file cannot be read or written.
    """
    assert detector.cell is not None
    assert evaluation.reliability is not None
    path = out or detector.base_folder / f"{detector.cell.cell}{envelope.MEASUREMENT_SUFFIX}"
    new_measurement = envelope.Measurement(
        detector=detector.name,
        fingerprint=dict(envelope.compute_fingerprint(detector.cell, detector.name, detector.base_folder)),
        command=command,
        seconds=round(duration, 1),
        images=evaluation.images,
        rates=evaluation.reliability.rates,
        classes={
            label: envelope.ErrorCounts(
                objects=sum(row.values()),
                missed=row.get(NO_OBJECT, 0),
                confused=sum(row.values()) - row.get(NO_OBJECT, 0) - row.get(label, 0),
                false_detections=evaluation.confusion.get(NO_OBJECT, {}).get(label, 0),
            )
            for label, row in evaluation.confusion.items()
            if label != NO_OBJECT
        },
        counts={
            str(count): envelope.ErrorCounts(**row) for count, row in sorted(evaluation.by_count.items())
        },
        frames=evaluation.frames,
        witness=evaluation.witness,
    )
    advice = "name another file with --out, and copy it into the folder of your cell file"
    with explain_os_errors(InputError, f"the measurement {path} cannot be written", advice):
        old_measurements = envelope.read_measurements(path)
        write_atomically(path, envelope.format_measurements(old_measurements, new_measurement))
    return path


def list_metrics(source: str, detector: str, evaluation: Evaluation) -> Iterator[RenderableType]:
    """Yield lines and tables with the accuracy of the detector `detector`, measured on `source`."""
    yield f"{source}, detector {detector}"
    yield f"  {evaluation.objects} objects on {evaluation.images} images, threshold {evaluation.threshold:g}"
    if evaluation.unavailable:
        fraction = evaluation.unavailable / evaluation.images
        images_text = f"{evaluation.unavailable} of {evaluation.images} images ({fraction:.1%})"
        yield f"  unavailable for {images_text}, last reason: {evaluation.why}"
    if not evaluation.answered_by:
        return
    yield (
        f"  precision {evaluation.precision:.2%}, recall {evaluation.recall:.2%}, "
        f"mAP50 {evaluation.map50:.4f}, mAP50-95 {evaluation.map50_95:.4f}"
    )
    if evaluation.by_class:
        table = _make_table("class", "objects", "precision", "recall")
        for label, metrics in evaluation.by_class.items():
            table.add_row(label, f"{metrics.objects}", f"{metrics.precision:.2%}", f"{metrics.recall:.2%}")
        yield table
        yield _make_confusion_table(evaluation)
    yield _make_error_table(evaluation)
    if (witness := evaluation.witness) is not None:
        counts = ", ".join(f"{found} of {total} {label}" for label, (found, total) in witness.objects.items())
        yield f"  objects that the image shows without a detection: {counts}"
        yield f"  regions without an object: {witness.false_regions}"
    if evaluation.reliability is not None:
        yield "  upper 95 % confidence bounds of the error rates, for the ledger:"
        yield "  " + ", ".join(f"{name} {value:g}" for name, value in evaluation.reliability.rates)
        yield ""


def _make_confusion_table(evaluation: Evaluation) -> Table:
    """Return a table with the number of objects by true class (rows) and detected class (columns)."""
    table = _make_table("true \\ detected", *next(iter(evaluation.confusion.values())))
    for true_class, counts in evaluation.confusion.items():
        # True negatives are not counted in object detection.
        cells = (
            "" if true_class == detected_class == NO_OBJECT else str(count)
            for detected_class, count in counts.items()
        )
        table.add_row(true_class, *cells)
    return table


def _make_error_table(evaluation: Evaluation) -> Table:
    """Return a table with the median, percentiles and maximum of the position errors and the latency."""
    table = _make_table("", "median", "95 %", "99 %", "worst")
    for quantity, distribution in (
        ("box centre error [px]", evaluation.centre),
        ("box centre error at the object's height [mm]", evaluation.position),
        ("localization error [mm]", evaluation.localized),
        ("time from frame to detections [ms]", evaluation.latency),
    ):
        if distribution is not None:
            table.add_row(quantity, *(f"{value:.2f}" for value in astuple(distribution)))
    return table


def _make_table(row_heading: str, *headings: str) -> Table:
    """Return an empty table with a left-aligned column for the names of rows, and right-aligned columns."""
    columns = (Column(heading, justify="right") for heading in headings)
    return Table(row_heading, *columns, box=SIMPLE_HEAD, padding=(0, 1))
