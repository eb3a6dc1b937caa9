"""What an agreement needs to know, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pydantic import Field

from executive.cell_config import DetectorConfig, Section
from executive.vision.detectors.members import wrong_members

NO_FIGURE = "an agreement has no {}: its answer is judged by those of the detectors it asks"


class AgreementOptions(Section):
    """What a detector of kind `agreement` has to know beside what every detector has."""

    detectors: tuple[str, ...] = Field(min_length=2)
    """Detectors of the cell that know the same classes; the boxes of the first one are preferred."""


def wrong_agreement(
    config: DetectorConfig, others: Mapping[str, DetectorConfig]
) -> Iterator[tuple[str, str]]:
    """Yield every option because of which an agreement could not be built, with a sentence.

    Args:
        config: The agreement's.
        others: All detectors of its cell, itself among them.
    """
    yield from wrong_members(AgreementOptions, config, others, NO_FIGURE)
