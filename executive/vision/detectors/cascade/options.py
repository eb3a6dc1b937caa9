"""What a cascade needs to know, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pydantic import Field

from executive.cell_config import DetectorConfig, Section
from executive.vision.detectors.members import wrong_members

NO_FIGURE = "a cascade has no {}: an answer is judged by that of the detector that gave it"


class CascadeOptions(Section):
    """What a detector of kind `cascade` has to know beside what every detector has."""

    detectors: tuple[str, ...] = Field(min_length=1)
    """Detectors of the cell, in the order in which they are asked."""
    failures: int = Field(2, ge=1)
    """After how many unavailable answers in a row one is left alone."""
    rest: float = Field(10.0, gt=0)
    """How long it is left alone then; afterwards it is tried again [s]."""


def wrong_cascade(config: DetectorConfig, others: Mapping[str, DetectorConfig]) -> Iterator[tuple[str, str]]:
    """Yield every option because of which a cascade could not be built, with a sentence.

    Args:
        config: The cascade's.
        others: All detectors of its cell, itself among them.
    """
    yield from wrong_members(CascadeOptions, config, others, NO_FIGURE)
