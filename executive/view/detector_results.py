"""Results of the evaluation of a detector, as text and tables."""

from __future__ import annotations

from collections.abc import Iterator

from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Column, Table

from executive.training.metrics import NO_OBJECT, Evaluation


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
    if set(evaluation.answered_by) != {detector}:
        counts = (f"{name} ({count})" for name, count in evaluation.answered_by.items())
        yield f"  answered by {', '.join(counts)}"
    yield (
        f"  precision {evaluation.precision:.2%}, recall {evaluation.recall:.2%}, "
        f"mAP50 {evaluation.map50:.4f}, mAP50-95 {evaluation.map50_95:.4f}"
    )
    if evaluation.by_class:
        yield _make_class_table(evaluation)
        yield _make_confusion_table(evaluation)
    yield _make_error_table(evaluation)
    if evaluation.reliability is not None:
        yield "  upper 95 % confidence bounds of the error rates, for the ledger:"
        yield "  " + ", ".join(f"{name} {value:g}" for name, value in evaluation.reliability.rates)
        yield ""


def _make_class_table(evaluation: Evaluation) -> Table:
    table = _make_table("class", "objects", "precision", "recall")
    for label, metrics in evaluation.by_class.items():
        table.add_row(label, f"{metrics.objects}", f"{metrics.precision:.2%}", f"{metrics.recall:.2%}")
    return table


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
            values = (distribution.median, distribution.p95, distribution.p99, distribution.worst)
            table.add_row(quantity, *(f"{value:.2f}" for value in values))
    return table


def _make_table(row_heading: str, *headings: str) -> Table:
    """Return an empty table with a left-aligned column for the names of rows, and right-aligned columns."""
    columns = (Column(heading, justify="right") for heading in headings)
    return Table(row_heading, *columns, box=SIMPLE_HEAD, padding=(0, 1))
