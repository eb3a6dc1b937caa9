"""Measuring a detector on labelled images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Protocol

import numpy as np

from executive.cell import Localizer
from executive.errors import NoDepth
from executive.geometry import Array
from executive.messages import Frame
from executive.vision.camera_model import on_plane
from executive.vision.evaluation.asking import Look
from executive.vision.evaluation.average_precision import AveragePrecision
from executive.vision.evaluation.figures import Evaluation, Spread
from executive.vision.evaluation.matching import Match, is_ignored, match
from executive.vision.evaluation.misses import WorstMisses
from executive.vision.evaluation.tally import Tally
from executive.vision.evaluation.truth import as_frame, is_whole
from executive.vision.samples import LabelledImage


class Examinee(Protocol):
    """A detector that is measured."""

    @property
    def threshold(self) -> float:
        """Confidence from which its detections count."""

    def ask(self, frame: Frame) -> Look:
        """Return what it says about a frame."""


def evaluate(
    examinee: Examinee,
    samples: Iterable[LabelledImage],
    *,
    threshold: float | None = None,
    localizer: Localizer | None = None,
    worst: WorstMisses | None = None,
) -> Evaluation:
    """Return how good a detector is on labelled images; ignored objects may be found or not.

    Args:
        examinee: The detector.
        samples: The images.
        threshold: Confidence from which a detection counts; None for the detector's own.
        localizer: Turns detections into positions, to be held against the objects' true ones.
        worst: Gathers the worst mistakes.
    """
    tally, precision, errors = Tally(), AveragePrecision(), _Errors(localizer)
    latencies: list[float] = []
    answered: Counter[str] = Counter()
    unavailable, why = 0, ""
    for number, sample in enumerate(samples, 1):
        frame = as_frame(sample, number)
        look = examinee.ask(frame)
        if look.why:
            unavailable, why = unavailable + 1, look.why
            continue
        answered[look.answered_by] += 1
        latencies.append(look.latency)
        found = [one for one in look.found if not is_ignored(one, sample)]
        precision.add(found, sample)
        least = look.threshold if threshold is None else threshold
        matches = match([one for one in found if one.confidence >= least], sample)
        tally.add(matches, sample)
        errors.add(matches, sample, frame)
        if worst is not None:
            worst.add(matches, sample)
    map50, map50_95 = precision.result()
    return Evaluation(
        threshold=examinee.threshold if threshold is None else threshold,
        images=unavailable + answered.total(),
        objects=tally.objects,
        precision=tally.precision,
        recall=tally.recall,
        map50=map50,
        map50_95=map50_95,
        centre=Spread.of(tally.offsets),
        position=Spread.of(errors.position),
        localized=Spread.of(errors.localized),
        # The first look warms up caches and connections.
        latency=Spread.of(latencies[1:] or latencies),
        by_class=tally.by_class(),
        confusion=tally.table(),
        unavailable=unavailable,
        why=why,
        answered_by=dict(answered),
        reliability=tally.reliability(),
    )


class _Errors:
    """How far off detections are in the world [mm], of right ones on objects that are wholly in view."""

    def __init__(self, localizer: Localizer | None) -> None:
        self._localizer = localizer
        self.position: list[float] = []
        self.localized: list[float] = []

    def add(self, matches: Iterable[Match], sample: LabelledImage, frame: Frame) -> None:
        for one in matches:
            if one.number is None or not one.right or not is_whole(sample.boxes[one.number], sample):
                continue
            if "positions" in sample.truth:
                true = np.array(sample.truth["positions"][one.number])
                meant = on_plane(frame.matrix, frame.X_WC, one.detection.centre, true[2])
                self.position.append(float(np.linalg.norm(meant - true) * 1000))
            if self._localizer is not None and "centres" in sample.truth:
                self._localize(one, np.array(sample.truth["centres"][one.number]), frame)

    def _localize(self, one: Match, true: Array, frame: Frame) -> None:
        assert self._localizer is not None
        try:
            located = self._localizer.locate(one.detection, frame)
        except NoDepth:
            return  # As in a run, it then has no place at all.
        self.localized.append(float(np.linalg.norm(located - true) * 1000))
