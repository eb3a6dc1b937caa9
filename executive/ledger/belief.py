"""Bayesian update of the existence and the class of one item, in log odds.

Looks from one viewpoint are not independent: a detector repeats a share of its errors.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from executive.cell.detection import Detections
from executive.cell.error_rates import ErrorRates

VIEWPOINT_PITCH = 0.02
"""Pitch of the grid to which camera positions are rounded [m]; equal rounded positions are one viewpoint."""
ITEM_AREA_SHARE = 0.02
"""Share of the searched area in which a false detection is assigned to a given item."""
MAX_LOG_ODDS_OF_ALTERNATIVE = math.log(0.1)
"""Maximum log odds of existence of a new item that may be a false localization of a known item nearby."""
LOG_ODDS_OF_PROOF = math.log(1e4)
"""Log odds of existence from which an item counts as proved: two looks of a good detector agree."""
MAX_ABS_LOG_ODDS = 100.0
"""Limit of log odds before they are converted to a probability."""


def viewpoint_of(look: Detections) -> str:
    """Return a key for detector and camera position of a look; looks with equal keys may repeat errors."""
    x, y, z = (round(float(value) / VIEWPOINT_PITCH) for value in look.frame.X_WC.position)
    return f"{look.detector} {x} {y} {z}"


def repeat_probability(independent_probability: float, copy_probability: float) -> float:
    """Return the probability that a look repeats the answer of an earlier look from the same viewpoint.

    Args:
        independent_probability: Probability of this answer in a look that is independent of the earlier one.
        copy_probability: Probability that the look is a copy of the earlier one.
    """
    return copy_probability + (1.0 - copy_probability) * independent_probability


@dataclass
class Belief:
    """Posterior of the existence and the class of an item.

    Attributes:
        first_label: Class in the first detection.
        log_odds: Log odds that the item exists and is no false detection.
        is_proved: True if the item exists for certain: enough looks agree, or the tool has touched it.
        miss_probability: Probability that all looks at its position since the last detection missed it.
        uncertain_looks: Number of looks with a low-confidence detection since the last confident detection.
        answers: Last detected class by viewpoint, since the item may have been moved.
        repeats: Number of looks that repeated the answer of an earlier look from the same viewpoint.
        log_likelihoods: Log likelihood of each detected class, up to a common constant.
        label_counts: Number of looks by detected class.
        confusion: Largest share of wrong classes among the detectors that saw the item.
    """

    first_label: str
    log_odds: float
    is_proved: bool = False
    miss_probability: float = 1.0
    uncertain_looks: int = 0
    answers: dict[str, str] = field(default_factory=dict)
    repeats: int = 0
    log_likelihoods: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    label_counts: Counter[str] = field(default_factory=Counter)
    confusion: float = 0.0

    @property
    def looks(self) -> int:
        """Number of looks that detected the item."""
        return self.label_counts.total()

    @property
    def label(self) -> str:
        """Most probable class, the first in the alphabet among equals."""
        if not self.label_counts:
            return self.first_label
        return min(self.log_likelihoods, key=lambda label: (-self.log_likelihoods[label], label))

    @property
    def class_error(self) -> float:
        """Probability that the item does not belong to the class `label`, 0 to 1.

        The hypotheses of Bayes' rule are the detected classes, and all other classes together as one.
        """
        if not self.label_counts:
            return 1.0
        best = self.log_likelihoods[self.label]
        others = (value for label, value in self.log_likelihoods.items() if label != self.label)
        odds = sum(math.exp(value - best) for value in (0.0, *others))
        return odds / (1.0 + odds)

    @property
    def p_value(self) -> float:
        """p-value of a binomial test of the number of looks with another class than `label`, 0 to 1.

        A small value shows that the detector errs more often than its error rates state.
        """
        n, p = self.looks, self.confusion
        wrong = n - self.label_counts[self.label]
        return 1.0 - sum(math.comb(n, k) * p**k * (1.0 - p) ** (n - k) for k in range(wrong))

    @property
    def probability(self) -> float:
        """Probability that the item exists, 0 to 1."""
        return 1.0 if self.is_proved else _probability_of(self.log_odds)

    @property
    def last_probability(self) -> float:
        """Probability that the item exists, 0 to 1, after the look that detected it last."""
        return 1.0 if self.is_proved else _probability_of(self.log_odds - math.log(self.miss_probability))

    def add_detection(
        self, label: str, rates: ErrorRates, viewpoint: str = "", *, is_ambiguous: bool = False
    ) -> None:
        """Update class and existence with a detection.

        If the detector repeats its answer from a viewpoint, only the independent share of its errors is
        evidence.

        Args:
            label: Detected class.
            rates: Error rates of the detector.
            viewpoint: Key of the look (`viewpoint_of`).
            is_ambiguous: True if the detection may show another item, and so does not prove this one.
        """
        repeated = rates.repeated if self.answers.get(viewpoint) == label else 0.0
        self.repeats += repeated > 0.0
        self.answers[viewpoint] = label
        self.log_likelihoods[label] += _log_ratio(1.0 - rates.confused, rates.confused, repeated)
        self.confusion = max(self.confusion, rates.confused)
        if is_ambiguous and not self.looks:
            self.log_odds = min(self.log_odds, MAX_LOG_ODDS_OF_ALTERNATIVE)
        elif not is_ambiguous and (self.looks or self.uncertain_looks):
            false_detection = min(rates.invented * ITEM_AREA_SHARE, 1.0)
            self.log_odds += _log_ratio(1.0 - rates.misses, false_detection, repeated)
        self.label_counts[label] += 1
        self.uncertain_looks = 0
        self.is_proved = self.is_proved or self.log_odds >= LOG_ODDS_OF_PROOF

    def add_miss(self, rates: ErrorRates) -> None:
        """Update the existence with a look that searched the item's position and did not detect it."""
        self.miss_probability *= rates.misses
        self.log_odds += math.log(rates.misses)

    def merge(self, other: Belief) -> None:
        """Add the detections of an item that proved to be this one."""
        for label, value in other.log_likelihoods.items():
            self.log_likelihoods[label] += value
        self.label_counts += other.label_counts
        self.miss_probability = 1.0


def _probability_of(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(log_odds, -MAX_ABS_LOG_ODDS)))


def _log_ratio(probability: float, alternative: float, repeated: float) -> float:
    """Return the log likelihood ratio of an answer that is a copy with the probability `repeated`."""
    return math.log(repeat_probability(probability, repeated) / repeat_probability(alternative, repeated))
