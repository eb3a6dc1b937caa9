"""One physical object as the ledger knows it, and what every look adds to that."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from executive.cell.detection import Detection
from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Frame
from executive.cell.objects import Target
from executive.cell.plain import rounded
from executive.events import ItemChanged
from executive.geometry import Array
from executive.ledger.independence import repeat_probability

LIKELY = 0.9
"""Probability of its existence from which an item is worth a grasp, and may be one missed elsewhere."""
NOTHING = "more looks missed it than saw it"
"""Why an item is a phantom."""
UNSURE = "no look is sure of it"
"""Why an item is given up that a detector is unsure of time and again."""
SAME_PLACE = 0.01
"""Distance up to which two measured positions count as the same place [m]."""
NEARBY = 0.02
"""Share of the searched area in which an invented box would be taken for a given item."""
INSIDE = 0.04
"""Share of the searched area in which an invented box would be taken for something in a given bin."""
DOUBTFUL = math.log(0.1)
"""Log odds of existence of something new that may as well be a known item, seen beside its place."""
CERTAIN = 100.0
"""Log odds beyond which more makes no difference."""
CONFIRMED = math.log(1e4)
"""Log odds of existence from which an item is known to exist: two looks of a good detector agree."""


class State(Enum):
    """What became of an item so far."""

    SEEN = "seen"
    """On the table, waiting; or in doubt, where no look has been sure of it yet."""
    HELD = "held"
    """Sealed to the tool."""
    DROPPED = "dropped"
    """Lost by the tool on the way, not found again yet; given up already if it says why."""
    PLACED = "placed"
    """Let go in a bin."""
    REJECTED = "rejected"
    """Left where it is because the mission had to sort it and could not."""
    SKIPPED = "skipped"
    """Left where it is because the mission did not have to sort it."""
    LOST = "lost"
    """Known to exist, and nowhere to be found."""
    PHANTOM = "phantom"
    """Believed for a look or two, contradicted by others: no object at all."""


OPEN = (State.SEEN, State.DROPPED)
LYING = (State.SEEN, State.REJECTED)
"""States of what lies on the table where it was seen."""
ON_TABLE = (*LYING, State.DROPPED)


@dataclass(eq=False)
class Record:
    """What is known of one item.

    Attributes:
        item: Its name, unique in the run.
        suspected: Class that it was first taken for.
        first: Where it was before it may have been moved for the first time `(3,)` [m].
        position: Mean of where it was seen since it may last have been moved `(3,)` [m].
        spread: Standard error of that along each axis [m].
        entered: Change count of the table when it was seen first.
        since: When it was seen first [s].
        epoch: Change count of the table when it was seen last.
        existence: Log odds that it is an object and no invention of a detector.
        overlooked: Chance that it is still where it was seen last, after all that has been searched since.
        glimpses: In how many looks since it was seen last a detector was unsure of something there.
        confidence: Of the last detection.
        frame: Id of the frame it was seen in last.
        stamp: When that was [s].
        state: What became of it.
        looks: In how many looks it was seen.
        bias: Standard deviation of the systematic error of its position, along each axis [m].
        answers: Last class by viewpoint (`executive.ledger.independence`), since it may last have been moved.
        repeats: Number of looks that repeated the answer of an earlier look from the same viewpoint.
        appeared: True if looks had found its place empty before one saw it there.
        moved: True once it has been seen again after something may have moved it.
        exists: True once it is known to exist: enough looks agree, or the tool has touched it.
        had_contact: True if the tool has touched it, at any height.
        touched: Class at whose height the tool has touched it last, or "".
        low_touches: Number of touches too low for its class since the last one at the height of its class.
        attempts: Failed attempts to pick it so far.
        empty_probes: Probes that found only the table at its place, since it last moved or was touched.
        bin: Where it was placed, or "".
        why: Why it was rejected, is lost, a phantom or believed to be in its bin, or "".
        contradictions: Number of looks that showed something which its class cannot be.
        contradiction: Evidence against its class besides the detector's score, or "".
        votes: Log likelihood of each class, up to a constant.
        tally: In how many looks it was taken for each class.
        expected: Share of them in which a detector as it says of itself is wrong.
        fallen: For an item that was dropped, log odds that it fell into each bin.
    """

    item: str
    suspected: str
    first: Array
    existence: float
    position: Array = field(init=False)
    spread: float = math.inf
    entered: int = 0
    since: float = -math.inf
    epoch: int = 0
    overlooked: float = 1.0
    glimpses: int = 0
    confidence: float = 0.0
    frame: int = 0
    stamp: float = 0.0
    state: State = State.SEEN
    looks: int = 0
    expected: float = 0.0
    bias: float = 0.0
    answers: dict[str, str] = field(default_factory=dict)
    repeats: int = 0
    appeared: bool = False
    moved: bool = False
    exists: bool = False
    had_contact: bool = False
    touched: str = ""
    low_touches: int = 0
    attempts: int = 0
    empty_probes: int = 0
    bin: str = ""
    why: str = ""
    contradictions: int = 0
    contradiction: str = ""
    votes: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    tally: Counter[str] = field(default_factory=Counter)
    fallen: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def __post_init__(self) -> None:
        self.position = self.first

    @property
    def label(self) -> str:
        """The likeliest class, the first in the alphabet among equals; a guess before any look is sure."""
        if not self.votes:
            return self.suspected
        return min(self.votes, key=lambda label: (-self.votes[label], label))

    @property
    def misjudged(self) -> float:
        """Chance that it is of another class than `label`, 0 to 1.

        By Bayes' rule over the classes it was taken for and, as one, all others.
        """
        if not self.votes:
            return 1.0
        best = self.label
        rivals = [0.0, *(vote for label, vote in self.votes.items() if label != best)]
        odds = sum(math.exp(vote - self.votes[best]) for vote in rivals)
        return odds / (1.0 + odds)

    @property
    def p_value(self) -> float:
        """Chance, 0 to 1, that looks disagree as much about its class as they do, by the errors stated.

        The upper tail of the binomial distribution: small where the detector errs more than it says.
        """
        looks, p = sum(self.tally.values()), self.expected
        wrong = looks - self.tally[self.label]
        return 1.0 - sum(math.comb(looks, k) * p**k * (1.0 - p) ** (looks - k) for k in range(wrong))

    @property
    def probability(self) -> float:
        """Chance that it is an object at all, 0 to 1."""
        return 1.0 if self.exists else _probability_of(self.existence)

    @property
    def last_probability(self) -> float:
        """Probability that it is an object, 0 to 1, when a look saw it last."""
        return 1.0 if self.exists else _probability_of(self.existence - math.log(self.overlooked))

    @property
    def target(self) -> Target:
        """The item on the table as skills see it."""
        return Target(
            self.item, self.label, self.position, self.confidence, self.frame, self.epoch, self.stamp
        )

    @property
    def summary(self) -> ItemChanged:
        """The item as an event, its position rounded to 0.1 mm."""
        return ItemChanged(
            self.item, self.label, self.state.value, rounded(self.position, 4),
            self.looks, self.attempts, self.bin, self.why,
        )  # fmt: skip

    def vote(self, label: str, by: ErrorRates, viewpoint: str = "", *, alone: bool = True) -> None:
        """Count one detection as `label`: that much likelier than any other class, by a detector's errors.

        That it was seen proves that it exists only if it is `alone`: nothing else may have been seen there.
        The same answer from the same viewpoint counts with the independent share of the errors only.
        """
        repeated = by.repeated if self.answers.get(viewpoint) == label else 0.0
        self.repeats += repeated > 0.0
        self.answers[viewpoint] = label
        self.bias = by.bias
        self.votes[label] += math.log(
            repeat_probability(1.0 - by.confused, repeated) / repeat_probability(by.confused, repeated)
        )
        self.tally[label] += 1
        self.expected = max(self.expected, by.confused)
        if not alone:
            self.existence = min(self.existence, DOUBTFUL) if not self.looks else self.existence
        elif self.looks or self.glimpses:
            false_detection = min(by.invented * NEARBY, 1.0)
            self.existence += math.log(
                repeat_probability(1.0 - by.misses, repeated) / repeat_probability(false_detection, repeated)
            )
        self.looks, self.glimpses = self.looks + 1, 0
        self.exists = self.exists or self.existence >= CONFIRMED

    def forget_answers(self) -> None:
        """Take further looks as independent of earlier ones, because something may have moved the item.

        What the looks before contradicted may have been its place.
        """
        self.answers.clear()
        self.repeats = self.contradictions = 0

    def locate(self, position: Array, spread: float, *, settled: bool) -> None:
        """Take a position `(3,)` [m] measured with a standard deviation of `spread` [m].

        It is averaged with those before where the item has `settled`, and replaces them where it may have
        been moved since.
        """
        if float(np.linalg.norm(position - self.position)) > SAME_PLACE:
            self.empty_probes = 0
        if settled and math.isfinite(self.spread):
            mine, new = self.spread**-2, spread**-2
            self.position = np.asarray((self.position * mine + position * new) / (mine + new))
            self.spread = (mine + new) ** -0.5
        else:
            self.moved = math.isfinite(self.spread)
            self.position, self.spread = position, spread
        if not self.moved:
            self.first = self.position
        self.overlooked = 1.0

    def shown(self, frame: Frame, detection: Detection) -> None:
        """Remember the look that saw it last."""
        if self.since == -math.inf:
            self.entered, self.since = frame.epoch, frame.stamp
        self.epoch, self.frame, self.stamp = frame.epoch, frame.id, frame.stamp
        self.confidence = detection.confidence

    def glimpsed(self, contradiction: str) -> None:
        """Count a look that was unsure of it, because of a contradiction or for a low confidence ("")."""
        self.glimpses += 1
        if contradiction:
            self.contradictions += 1
            self.contradiction = contradiction

    def miss(self, by: ErrorRates) -> None:
        """Count one look that searched its place without seeing it."""
        self.overlooked *= by.misses
        self.existence += math.log(by.misses)

    def fell(self, bin: str, shown: bool, by: ErrorRates) -> None:
        """Count one look into a bin that showed, or did not, one object more than was let go there."""
        evidence = (1.0 - by.misses) / (by.invented * INSIDE) if shown else by.misses
        self.fallen[bin] = max(0.0, self.fallen[bin] + math.log(evidence))

    def become(self, found: Record) -> None:
        """Take over what is known of `found`, a new item that turned out to be this one."""
        for label, vote in found.votes.items():
            self.votes[label] += vote
        self.tally += found.tally
        self.empty_probes = 0
        self.position, self.spread, self.epoch = found.position, found.spread, found.epoch
        self.frame, self.stamp, self.confidence = found.frame, found.stamp, found.confidence
        self.overlooked = 1.0
        self.looks += found.looks
        # Where it was first, it was before it fell or was pushed.
        self.moved = True
        if self.state is State.PHANTOM:
            self.existence, self.why = found.existence, ""
        if self.state in (State.DROPPED, State.PHANTOM):
            self.state = State.REJECTED if self.why else State.SEEN


def _probability_of(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(log_odds, -CERTAIN)))
