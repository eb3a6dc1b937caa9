"""Bayesian update of the existence and the class of one item, in log odds.

A look is an image with its detections. Looks from one viewpoint are not independent, because a detector
repeats a fraction of its errors.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from executive.cell.detection import Detections
from executive.cell.error_rates import ErrorRates

VIEWPOINT_GRID_SPACING = 0.02
"""Spacing of the grid to which camera positions are rounded [m]; equal grid points are one viewpoint."""
ITEM_AREA_FRACTION = 0.02
"""Probability that a false detection is assigned to a given item: its area as a fraction of the image."""
MAX_LOG_ODDS_OF_AMBIGUOUS_ITEM = math.log(0.1)
"""Maximum log odds of existence of a new item that may be a known item, detected at a wrong position."""
LOG_ODDS_OF_PROOF = math.log(1e4)
"""Minimum log odds of existence of a proved item; two agreeing looks of a good detector reach them."""
MIN_LOG_ODDS = -100.0
"""Lower log odds are raised to this value before their conversion to a probability, which would overflow."""


def make_viewpoint_key(look: Detections) -> str:
    """Return a key of the detector and camera position of a look; looks with equal keys may repeat errors."""
    x, y, z = (round(float(value) / VIEWPOINT_GRID_SPACING) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def compute_repeat_probability(independent_probability: float, copy_probability: float) -> float:
    """Return the probability that a look gives the same answer as an earlier look from the same viewpoint.

    Args:
        independent_probability: Probability of this answer in an independent look.
        copy_probability: Probability that the look is a copy of the earlier look.
    """
    return copy_probability + (1.0 - copy_probability) * independent_probability


@dataclass
class Belief:
    """Posterior of the existence and the class of an item.

    Attributes:
        first_label: Class in the first detection.
        log_odds: Posterior log odds that the item exists and is no false detection.
        is_proved: True if the item certainly exists: enough looks agree, or the tool has touched the item.
        miss_probability: Probability that all looks since the last detection missed the item by chance.
        uncertain_look_count: Number of looks with a low-confidence detection since the last confident one.
        last_label_by_viewpoint: Last detected class by viewpoint, since the item may last have been moved.
        repeat_count: Number of looks that repeated the class of an earlier look from the same viewpoint.
        log_likelihoods: Log likelihood of each detected class, up to a common constant.
        label_counts: Number of looks by detected class.
        max_confusion_rate: Largest rate of wrong classes of the detectors that detected the item, 0 to 1.
    """

    first_label: str
    log_odds: float
    is_proved: bool = False
    miss_probability: float = 1.0
    uncertain_look_count: int = 0
    last_label_by_viewpoint: dict[str, str] = field(default_factory=dict)
    repeat_count: int = 0
    log_likelihoods: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    label_counts: Counter[str] = field(default_factory=Counter)
    max_confusion_rate: float = 0.0

    @property
    def look_count(self) -> int:
        """Number of looks that detected the item."""
        return self.label_counts.total()

    @property
    def label(self) -> str:
        """Most probable class; among equally probable classes, the first in alphabetical order."""
        if not self.label_counts:
            return self.first_label
        return min(self.log_likelihoods, key=lambda label: (-self.log_likelihoods[label], label))

    @property
    def class_error(self) -> float:
        """Probability that the item does not belong to the class `label`, 0 to 1.

        The hypotheses of Bayes' rule are each detected class, and one class for all others.
        """
        if not self.label_counts:
            return 1.0
        best = self.log_likelihoods[self.label]
        others = (value for label, value in self.log_likelihoods.items() if label != self.label)
        odds = sum(math.exp(value - best) for value in (0.0, *others))  # odds of any other class
        return odds / (1.0 + odds)

    @property
    def p_value(self) -> float:
        """p-value of a binomial test of the number of looks with another class than `label`, 0 to 1.

        A small value shows that the detector confuses classes more often than its error rates state.
        """
        n, p = self.look_count, self.max_confusion_rate
        wrong_count = n - self.label_counts[self.label]
        return 1.0 - sum(math.comb(n, k) * p**k * (1.0 - p) ** (n - k) for k in range(wrong_count))

    @property
    def existence_probability(self) -> float:
        """Probability that the item exists, 0 to 1."""
        return 1.0 if self.is_proved else _to_probability(self.log_odds)

    @property
    def probability_at_last_detection(self) -> float:
        """Probability that the item exists, without the looks since the last detection, 0 to 1."""
        return 1.0 if self.is_proved else _to_probability(self.log_odds - math.log(self.miss_probability))

    def add_detection(
        self, label: str, rates: ErrorRates, viewpoint: str = "", *, is_ambiguous: bool = False
    ) -> None:
        """Update class and existence with a detection.

        If the detector repeats the class of an earlier look from a viewpoint, the evidence is weaker.

        Args:
            label: Detected class.
            rates: Error rates of the detector.
            viewpoint: Viewpoint of the look (`make_viewpoint_key`).
            is_ambiguous: True if the detection may show another item; then it is no evidence of existence.
        """
        copied = rates.repeated if self.last_label_by_viewpoint.get(viewpoint) == label else 0.0
        self.repeat_count += copied > 0.0
        self.last_label_by_viewpoint[viewpoint] = label
        confusion_rate = rates.confusion_rate
        self.log_likelihoods[label] += _compute_log_ratio(1.0 - confusion_rate, confusion_rate, copied)
        self.max_confusion_rate = max(self.max_confusion_rate, confusion_rate)
        if is_ambiguous and not self.look_count:
            self.log_odds = min(self.log_odds, MAX_LOG_ODDS_OF_AMBIGUOUS_ITEM)
        elif not is_ambiguous and (self.look_count or self.uncertain_look_count):
            false_positive_rate = min(rates.false_detections * ITEM_AREA_FRACTION, 1.0)
            self.log_odds += _compute_log_ratio(1.0 - rates.miss_rate, false_positive_rate, copied)
        self.label_counts[label] += 1
        self.uncertain_look_count = 0
        self.is_proved = self.is_proved or self.log_odds >= LOG_ODDS_OF_PROOF

    def add_miss(self, rates: ErrorRates) -> None:
        """Update the existence with a look that shows the item's position without a detection of the item."""
        self.miss_probability *= rates.miss_rate
        self.log_odds += math.log(rates.miss_rate)

    def merge(self, other: Belief) -> None:
        """Add the detections of an item that is the same object."""
        for label, value in other.log_likelihoods.items():
            self.log_likelihoods[label] += value
        self.label_counts += other.label_counts
        self.miss_probability = 1.0


def _to_probability(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(log_odds, MIN_LOG_ODDS)))


def _compute_log_ratio(probability: float, alternative: float, copy_probability: float) -> float:
    """Return the log likelihood ratio of an answer with these probabilities under two hypotheses.

    `copy_probability` is the probability that the answer is a copy of an earlier answer.
    """
    p, p_alternative = (compute_repeat_probability(p, copy_probability) for p in (probability, alternative))
    return math.log(p / p_alternative)
