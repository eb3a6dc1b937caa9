"""How a detector errs, in the four figures that its section of a cell file states."""

from __future__ import annotations

from dataclasses import dataclass

from executive.vision.evaluation.bounds import rate_bound, rounded_up, share_bound

MOST = 0.99
"""Largest share that a cell file is advised to state: it takes none of 1."""
LEAST_JITTER = 0.01
"""Smallest jitter that a cell file is advised to state [pixel]: it takes none of 0."""


@dataclass(frozen=True)
class Count:
    """A rate that was measured by counting.

    Attributes:
        events: How often it happened.
        trials: Of how many.
        bound: Upper 95 % bound of the rate.
    """

    events: int
    trials: int
    bound: float


@dataclass(frozen=True)
class MeasuredReliability:
    """How a detector errs on objects in full view, for `executive.messages.Reliability`.

    Attributes:
        misses: Objects that it overlooked, of those in full view.
        confused: Objects that it gave a wrong class, of those it found.
        invented: Objects that are not there, per look.
        jitter: Standard deviation of the centre of a found box, along each axis [pixel of the frame].
    """

    misses: Count
    confused: Count
    invented: Count
    jitter: float

    @staticmethod
    def of(
        *, whole: int, overlooked: int, confused: int, invented: int, looks: int, jitter: float
    ) -> MeasuredReliability:
        """Return the figures; `whole` counts the objects in full view, `looks` the answers."""
        found = whole - overlooked
        return MeasuredReliability(
            Count(overlooked, whole, share_bound(overlooked, whole)),
            Count(confused, found, share_bound(confused, found)),
            Count(invented, looks, rate_bound(invented, looks)),
            jitter,
        )

    @property
    def stated(self) -> dict[str, float]:
        """What a cell file should say, by its keys: upper bounds, rounded up, in the range that it takes."""
        return {
            "misses": min(rounded_up(self.misses.bound), MOST),
            "confused": min(rounded_up(self.confused.bound), MOST),
            "invented": rounded_up(self.invented.bound),
            "jitter": max(rounded_up(self.jitter), LEAST_JITTER),
        }

    def yaml(self) -> str:
        """Return the lines for the detector's section of a cell file, with what was counted."""
        remarks = (
            f"{self.misses.events} of {self.misses.trials} objects in full view; upper 95 % bound",
            f"{self.confused.events} of {self.confused.trials} found; upper 95 % bound",
            f"{self.invented.events} in {self.invented.trials} looks; upper 95 % bound",
            "pixels of the frame, as measured",
        )
        lines = [f"{key}: {value:g}" for key, value in self.stated.items()]
        width = max(map(len, lines))
        return "\n".join(f"{line:{width}}  # {remark}" for line, remark in zip(lines, remarks, strict=True))
