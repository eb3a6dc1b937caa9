"""The detector that asks others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from executive.cell import Clock
from executive.cell_config import DetectorConfig
from executive.messages import Frame
from executive.vision.detectors.cascade.breaker import Breaker
from executive.vision.detectors.cascade.options import CascadeOptions, wrong_cascade
from executive.vision.detectors.cascade.request import CascadeRequest, Member
from executive.vision.detectors.members import labels_of_members
from executive.vision.detectors.options import read_options
from executive.vision.detectors.setting import NO_OTHERS, Setting


class CascadeDetector:
    """Asks the first of several detectors, and the next one where that gives no answer.

    One that fails again and again is left alone for a while, then tried again, so the first is back soon
    after it recovers. Implements `executive.cell.Detector`.

    Args:
        members: Whom to ask, in order.
        latency: Time from a question to the first answer that is visible [s].
        clock: The run's clock.
    """

    def __init__(self, members: Sequence[Member], latency: float, clock: Clock) -> None:
        self._members = tuple(members)
        self._latency = latency
        self._clock = clock
        self._last: CascadeRequest | None = None

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: Setting) -> CascadeDetector:
        """Return the detector that a cell file describes.

        Raises:
            InputError: An option is missing, unknown or wrong, or a member is not there or rests on this one.
        """
        options = read_options(CascadeOptions, config)
        members = [
            Member(name, setting.other(name), Breaker(options.failures, options.rest))
            for name in options.detectors
        ]
        return cls(members, config.latency, setting.clock)

    @staticmethod
    def check(
        config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig] = NO_OTHERS
    ) -> Iterator[tuple[str, str]]:
        """Yield every option because of which the detector could not be built, with a sentence."""
        del base
        yield from wrong_cascade(config, others)

    @staticmethod
    def labels(
        config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig] = NO_OTHERS
    ) -> tuple[str, ...] | None:
        """Return what any of its members finds, by the cell's names; None where one does not say."""
        if any(True for _ in wrong_cascade(config, others)):
            return None
        return labels_of_members(config, base, others)

    def request(self, frame: Frame, view: str) -> CascadeRequest:
        """Start to search `frame`: the `table` part or the `full` image."""
        if self._last is not None:
            self._last.hear()
        due = self._clock.now + self._latency
        self._last = CascadeRequest(self._members, frame, view, due, self._clock)
        return self._last

    def close(self) -> None:
        """Have nothing to give back: the members belong to the cell."""
