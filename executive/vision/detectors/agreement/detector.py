"""The detector that asks others and has them contradict each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from executive.cell import Clock, Detector
from executive.cell_config import DetectorConfig
from executive.messages import Frame
from executive.vision.detectors.agreement.options import AgreementOptions, wrong_agreement
from executive.vision.detectors.agreement.request import AgreementRequest
from executive.vision.detectors.members import labels_of_members
from executive.vision.detectors.options import read_options
from executive.vision.detectors.setting import NO_OTHERS, Setting


class AgreementDetector:
    """Asks several detectors about every frame, and answers what they say together.

    One that errs the same way in every look contradicts only another one, never itself. Implements
    `executive.cell.Detector`.

    Args:
        name: Its name in the cell file.
        members: Whom to ask, by name; the boxes of the first one are preferred.
        latency: Least time from a question to its answer [s].
        clock: The run's clock.
    """

    def __init__(self, name: str, members: Mapping[str, Detector], latency: float, clock: Clock) -> None:
        self._name = name
        self._members = dict(members)
        self._latency = latency
        self._clock = clock

    @classmethod
    def from_config(cls, config: DetectorConfig, setting: Setting) -> AgreementDetector:
        """Return the detector that a cell file describes.

        Raises:
            InputError: An option is missing, unknown or wrong, or a member is not there or rests on this one.
        """
        options = read_options(AgreementOptions, config)
        members = {name: setting.other(name) for name in options.detectors}
        return cls(setting.name, members, config.latency, setting.clock)

    @staticmethod
    def check(
        config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig] = NO_OTHERS
    ) -> Iterator[tuple[str, str]]:
        """Yield every option because of which the detector could not be built, with a sentence."""
        del base
        yield from wrong_agreement(config, others)

    @staticmethod
    def labels(
        config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig] = NO_OTHERS
    ) -> tuple[str, ...] | None:
        """Return what any of its members finds, by the cell's names; None where one does not say."""
        if any(True for _ in wrong_agreement(config, others)):
            return None
        return labels_of_members(config, base, others)

    def request(self, frame: Frame, view: str) -> AgreementRequest:
        """Have every member start to search `frame`: the `table` part or the `full` image."""
        due = self._clock.now + self._latency
        requests = {name: member.request(frame, view) for name, member in self._members.items()}
        return AgreementRequest(self._name, requests, due, self._clock)

    def close(self) -> None:
        """Have nothing to give back: the members belong to the cell."""
