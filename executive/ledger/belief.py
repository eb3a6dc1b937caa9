"""Bayesian update of the existence and the class of one item, in log odds.

A look is an image with its detections. Looks from one viewpoint are not independent, because a detector
repeats a fraction of its errors in similar images.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from executive.cell.frame import Detections, ErrorRates

VIEWPOINT_GRID_SPACING = 0.02
"""Spacing of the grid to which camera positions are rounded [m]; equal grid points are one viewpoint."""
ITEM_AREA_FRACTION = 0.02
"""Image fraction covered by an item, used as the probability that a false detection is assigned to it."""
MAX_LOG_ODDS_OF_AMBIGUOUS_ITEM = math.log(0.1)
"""Maximum log odds of existence of a new item that may be a known item at a wrongly measured position."""
CONFIRMATION_LOG_ODDS = math.log(1e4)
"""Minimum log odds of existence of a confirmed item (`Belief.is_confirmed`); two detections of the same class
may reach the minimum."""
PRIOR_REMOVAL_PROBABILITY = 0.0015
"""Prior probability that a person takes an item away in a run. The first detection of a good detector leaves
odds of existence of 200, and each repeated detection multiplies them by 1.7: an item that four looks showed
was probably there; after one to three looks, it may be a false detection."""
MIN_LOG_ODDS = -700.0
"""Log odds below which a probability counts as the probability at this limit; `math.exp` overflows at 710."""


def make_viewpoint_key(look: Detections) -> str:
    """Return a key of the detector and the rounded camera position of a look."""
    x, y, z = (round(float(value) / VIEWPOINT_GRID_SPACING) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def compute_repeat_probability(independent_probability: float, error_correlation: float) -> float:
    """Return the probability of the same answer as in an earlier look from the viewpoint, also by chance.

    Args:
        independent_probability: Probability of the answer (a class, or no detection) in an independent look.
        error_correlation: Probability that the answer is a copy of the earlier answer; otherwise, both
            answers are independent.
    """
    return error_correlation + (1.0 - error_correlation) * independent_probability


def compute_probability(log_odds: float) -> float:
    """Return the probability with the given log odds."""
    return 1.0 / (1.0 + math.exp(-max(log_odds, MIN_LOG_ODDS)))


def compute_binomial_tail(min_count: int, trial_count: int, probability: float) -> float:
    """Return the probability of at least `min_count` events in independent trials.

    Args:
        min_count: Number of events, at most `trial_count`.
        trial_count: Number of trials.
        probability: Probability of an event in one trial, above 0 and below 1.
    """
    # scipy.special contains this function, but its import takes 0.5 s.
    if min_count <= 0:
        return 1.0
    log_p = math.log(probability)
    log_q = math.log1p(-probability)
    return math.fsum(
        math.exp(math.log(math.comb(trial_count, count)) + count * log_p + (trial_count - count) * log_q)
        for count in range(min_count, trial_count + 1)
    )


@dataclass
class Belief:
    """Posterior of the existence and the class of an item.

    Attributes:
        first_label: Class in the first detection.
        label: Most probable class; among equally probable classes, the first in alphabetical order.
        detected_label: Class that the detectors report for an object of the class `label`.
        log_odds: Posterior log odds that the item exists.
        is_confirmed: True if the item certainly exists, by the log odds or by a touch of the tool.
        miss_probability: Probability that all looks since the last detection missed the item by chance.
        low_confidence_count: Number of looks with a doubtful detection since the last confident detection.
        last_label_by_viewpoint: For each viewpoint key, the class of the last detection, or "" if the last
            look was a miss in `add_miss`. `ItemRecord.clear_viewpoints` clears the mapping.
        miss_count_by_viewpoint: For each viewpoint key, number of misses in `add_miss`; cleared together with
            `last_label_by_viewpoint`.
        repeat_count: Number of looks that repeated the class of an earlier look from the same viewpoint.
        log_likelihoods: Log likelihood of each detected class, relative to a class that was never detected.
        label_counts: For each detected class, number of looks.
        max_confusion_rate: Largest confusion rate of the detectors that detected the item, 0 to 1.
        label_map: For each class of the cell, the class that the detectors report for it; empty
            before the first weighing. Until then, a key of `log_likelihoods` stands for all classes with the
            same appearance.
        weight_log_ratios: For each class, log likelihood ratio of the last weighing, which `log_likelihoods`
            already contains.
    """

    first_label: str
    label: str = field(init=False)
    detected_label: str = field(init=False)
    log_odds: float
    is_confirmed: bool = False
    miss_probability: float = 1.0
    low_confidence_count: int = 0
    last_label_by_viewpoint: dict[str, str] = field(default_factory=dict)
    miss_count_by_viewpoint: Counter[str] = field(default_factory=Counter)
    repeat_count: int = 0
    log_likelihoods: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    label_counts: Counter[str] = field(default_factory=Counter)
    max_confusion_rate: float = 0.0
    label_map: Mapping[str, str] = field(default_factory=dict)
    weight_log_ratios: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.label = self.first_label
        self.detected_label = self.first_label

    @property
    def look_count(self) -> int:
        """Number of looks with a confident detection of the item."""
        return self.label_counts.total()

    @property
    def class_error(self) -> float:
        """Probability that the item does not belong to the class `label`, 0 to 1.

        The hypotheses of Bayes' rule are the detected classes, and one class that was never detected.
        """
        if not self.label_counts:
            return 1.0
        other_values = (value for label, value in self.log_likelihoods.items() if label != self.label)
        log_likelihood_of_others = float(np.logaddexp.reduce([0.0, *other_values]))
        return compute_probability(log_likelihood_of_others - self.log_likelihoods[self.label])

    @property
    def confusion_p_value(self) -> float:
        """p-value of a binomial test of the number of looks with another class than `label`, 0 to 1.

        A small value shows that the detector confuses classes more often than its error rates state.
        """
        wrong_count = self.look_count - self.label_counts[self.detected_label]
        return compute_binomial_tail(wrong_count, self.look_count, self.max_confusion_rate)

    @property
    def existence_probability(self) -> float:
        """Probability that the item exists, 0 to 1."""
        return 1.0 if self.is_confirmed else compute_probability(self.log_odds)

    @property
    def is_probable(self) -> bool:
        """True if the item exists with a probability of at least 0.5."""
        return self.existence_probability >= 0.5

    @property
    def removal_probability(self) -> float:
        """Probability that an item was there and left, 0 to 1; otherwise, it never existed.

        Looks since the last detection miss an item that left, and one that never existed, with probability 1.
        With the odds o of existence at the last detection and the prior probability r of a removal, the
        hypotheses "exists", "left" and "never existed" have the posteriors o * (1 - r) * m, o * r and 1, up
        to a common factor; m is `miss_probability`.
        """
        return compute_probability(self.log_odds_at_last_detection + math.log(PRIOR_REMOVAL_PROBABILITY))

    @property
    def log_odds_at_last_detection(self) -> float:
        """Log odds of existence without the evidence since the last detection; infinite if confirmed."""
        return math.inf if self.is_confirmed else self.log_odds - math.log(self.miss_probability)

    def add_detection(
        self, label: str, rates: ErrorRates, viewpoint: str = "", *, is_ambiguous: bool = False
    ) -> None:
        """Update class and existence with a detection.

        A class that was detected before from the same viewpoint is weaker evidence.

        Args:
            label: Detected class.
            rates: Error rates of the detector.
            viewpoint: Key of detector and camera position (`make_viewpoint_key`).
            is_ambiguous: True if the detection may show another item, and is no evidence of existence.
        """
        error_correlation = rates.repeated if self.last_label_by_viewpoint.get(viewpoint) == label else 0.0
        self.repeat_count += error_correlation > 0.0
        self.last_label_by_viewpoint[viewpoint] = label
        confusion_rate = rates.confusion_rate
        class_evidence = _compute_log_ratio(1.0 - confusion_rate, confusion_rate, error_correlation)
        self._add_class_evidence(label, class_evidence)
        self.max_confusion_rate = max(self.max_confusion_rate, confusion_rate)
        if is_ambiguous and not self.look_count:
            self.log_odds = min(self.log_odds, MAX_LOG_ODDS_OF_AMBIGUOUS_ITEM)
        # The prior odds of an item whose first detection is confident contain the evidence of this detection.
        elif not is_ambiguous and (self.look_count or self.low_confidence_count):
            false_positive_rate = min(rates.false_detections * ITEM_AREA_FRACTION, 1.0)
            self.log_odds += _compute_log_ratio(1.0 - rates.miss_rate, false_positive_rate, error_correlation)
        self.label_counts[label] += 1
        self._update_labels()
        self.low_confidence_count = 0
        self.is_confirmed = self.is_confirmed or self.log_odds >= CONFIRMATION_LOG_ODDS

    def add_miss(
        self, rates: ErrorRates, viewpoint: str | None = None, *, was_detected_here: bool = True
    ) -> None:
        """Update the existence with a look that shows the item's position, but does not detect the item.

        With a `viewpoint`, a miss is weak evidence if it repeats an earlier miss from this viewpoint.
        `was_detected_here` is False if no look has detected the item at this position: the detector may then
        be unable to detect the item, such as a red cube in a red bin. With the probability `rates.repeated`,
        all later looks from the viewpoint repeat the first miss, so that no number of looks is a proof.
        """
        count = 0 if viewpoint is None else self.miss_count_by_viewpoint[viewpoint]
        miss_rate = compute_repeat_probability(rates.miss_rate, rates.repeated if count else 0.0)
        if count and not was_detected_here:
            # Probability of one more miss after `count` misses.
            miss_rate = compute_repeat_probability(rates.miss_rate**count, rates.repeated)
            miss_rate /= compute_repeat_probability(rates.miss_rate ** (count - 1), rates.repeated)
        if viewpoint is not None:
            self.last_label_by_viewpoint[viewpoint] = ""
            self.miss_count_by_viewpoint[viewpoint] += 1
        self.miss_probability *= miss_rate
        self.log_odds += math.log(miss_rate)

    def add_weighing(self, log_ratios: Mapping[str, float], label_map: Mapping[str, str]) -> None:
        """Update the class with a weighing, which distinguishes classes that look alike.

        A weighing replaces the previous one, because both share the same systematic error.

        Args:
            log_ratios: For each class, log likelihood ratio of the measured weight: an object of the class
                against an object of no declared class.
            label_map: For each class of the cell, the class that the detectors report for it.
        """
        if not self.label_map:
            old = self.log_likelihoods
            new = {label: old[detected] for label, detected in label_map.items() if detected in old}
            self.log_likelihoods = defaultdict(float, new)
            self.label_map = label_map
        for label in self.log_likelihoods:
            self.log_likelihoods[label] += log_ratios[label] - self.weight_log_ratios.get(label, 0.0)
        self.weight_log_ratios = {label: log_ratios[label] for label in self.log_likelihoods}
        self._update_labels()

    def merge(self, duplicate: Belief) -> None:
        """Add the detections of a duplicate item, which is the same object and was never weighed."""
        for label, value in duplicate.log_likelihoods.items():
            self._add_class_evidence(label, value)
        self.label_counts += duplicate.label_counts
        self._update_labels()
        self.miss_probability = 1.0

    def _update_labels(self) -> None:
        if self.label_counts:
            self.label = min(self.log_likelihoods, key=lambda label: (-self.log_likelihoods[label], label))
        self.detected_label = self.label_map.get(self.label, self.label)

    def _add_class_evidence(self, detected_label: str, log_ratio: float) -> None:
        """Add the log likelihood ratio of a detected class to each class that looks like it."""
        alike = [label for label, other in self.label_map.items() if other == detected_label]
        for label in alike or [detected_label]:
            self.log_likelihoods[label] += log_ratio


def _compute_log_ratio(probability: float, alternative: float, error_correlation: float) -> float:
    """Return the log likelihood ratio of an answer, which may repeat the error of an earlier answer.

    `probability` and `alternative` are the probabilities of an independent answer under both hypotheses.
    """
    numerator = compute_repeat_probability(probability, error_correlation)
    return math.log(numerator / compute_repeat_probability(alternative, error_correlation))
