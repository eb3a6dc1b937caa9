"""Measuring a detector on labelled images."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from executive.cell.config import TableConfig
from executive.cell.protocols import Localizer
from executive.errors import Unavailable
from executive.perception.envelope.frame_statistics import FrameRange, FrameStatistics, measure_frame
from executive.training.evaluation.asking import CellDetector
from executive.training.evaluation.average_precision import AveragePrecision
from executive.training.evaluation.figures import Evaluation, Spread
from executive.training.evaluation.matching import is_ignored, match
from executive.training.evaluation.misses import WorstMisses
from executive.training.evaluation.repeats import RepeatedErrors
from executive.training.evaluation.tally import Tally
from executive.training.evaluation.truth import as_frame
from executive.training.samples import LabelledImage


def evaluate(
    detector: CellDetector,
    samples: Iterable[LabelledImage],
    *,
    threshold: float | None = None,
    localizer: Localizer | None = None,
    worst: WorstMisses | None = None,
    table: TableConfig | None = None,
) -> Evaluation:
    """Return how good a detector is on labelled images; ignored objects may be found or not.

    Args:
        detector: The detector.
        samples: The images.
        threshold: Confidence from which a detection counts; None for the detector's own.
        localizer: Turns detections into positions, to be held against the objects' true ones.
        worst: Gathers the worst mistakes.
        table: Declares the workspace whose brightness, contrast and colours are measured; None: they are not.
    """
    tally, precision, repeats = Tally(localizer), AveragePrecision(), RepeatedErrors(localizer)
    frames: list[FrameStatistics] = []
    latencies: list[float] = []
    answered: Counter[str] = Counter()
    unavailable, why = 0, ""
    for number, sample in enumerate(samples, 1):
        frame = as_frame(sample, number)
        try:
            answer, latency = detector.ask(frame)
        except Unavailable as error:
            unavailable, why = unavailable + 1, str(error)
            continue
        answered[answer.detector] += 1
        latencies.append(latency)
        found = [one for one in answer.found if not is_ignored(one, sample)]
        precision.add(found, sample)
        least = answer.error_rates.threshold if threshold is None else threshold
        matches = match([one for one in found if one.confidence >= least], sample)
        tally.add(matches, sample, frame)
        if sample.second is not None:
            with contextlib.suppress(Unavailable):
                second, _ = detector.ask(replace(frame, image=sample.second))
                found = [one for one in second.found if not is_ignored(one, sample)]
                sure = [one for one in found if one.confidence >= least]
                repeats.add(matches, match(sure, sample), sample, frame)
        if table is not None and (statistics := measure_frame(frame, table)):
            frames.append(statistics)
        if worst is not None:
            worst.add(matches, sample)
    map50, map50_95 = precision.result()
    return Evaluation(
        threshold=detector.threshold if threshold is None else threshold,
        images=unavailable + answered.total(),
        objects=tally.objects,
        precision=tally.precision,
        recall=tally.recall,
        map50=map50,
        map50_95=map50_95,
        centre=Spread.of(tally.centre),
        position=Spread.of(tally.position),
        localized=Spread.of(tally.localized),
        # The first look warms up caches and connections.
        latency=Spread.of(latencies[1:] or latencies),
        by_class=tally.by_class(),
        confusion=tally.table(),
        unavailable=unavailable,
        why=why,
        answered_by=dict(answered),
        by_count={count: dict(errors) for count, errors in tally.by_count.items()},
        reliability=tally.estimate_error_rates(repeats),
        frames=FrameRange.of(frames),
    )
