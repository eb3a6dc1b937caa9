"""Settings of a detector: the parts of the run that it uses, and the options of its kind."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from executive.cell.config import CameraConfig, DetectorConfig, Section
from executive.cell.protocols import Clock, Detector
from executive.errors import InputError

OptionFaults = Iterator[tuple[str, str]]
"""Missing, unknown or invalid options of a detector, each with an error message."""
OptionsT = TypeVar("OptionsT", bound=Section)


class ClosableDetector(Detector, Protocol):
    """A detector that holds resources, such as a thread, until it is closed."""

    def close(self) -> None:
        """Wait for the search in progress and release the resources."""


@dataclass(frozen=True)
class DetectorSetting:
    """Parts of the cell and of the run that a detector uses.

    Attributes:
        name: Name of the detector in the cell file.
        camera: The camera whose frames the detector searches.
        clock: Clock of the run, for the times at which answers become visible.
        base: Folder to which paths in options are relative.
        seed: Random seed of the detector.
        other: Builds or returns another detector of the cell by name; the caller must not close it.
    """

    name: str
    camera: CameraConfig
    clock: Clock
    base: Path
    seed: int
    other: Callable[[str], Detector]


def find_wrong_options(options: type[Section], config: DetectorConfig) -> OptionFaults:
    """Yield each missing, unknown or invalid option of a kind of detector, with an error message."""
    try:
        options.model_validate(config.options)
    except ValidationError as error:
        known = ", ".join(options.model_fields) or "none"
        problems: dict[str, ErrorDetails] = {}
        for problem in error.errors():  # One per type if a value has none of several types.
            problems.setdefault(str(problem["loc"][0]), problem)
        for option, problem in problems.items():
            place = ".".join(map(str, problem["loc"]))
            yield (
                option,
                f'option "{place}" of a detector of kind {config.kind}: {problem["msg"].lower()}; '
                f"its options: {known}",
            )


def read_options(options: type[OptionsT], config: DetectorConfig) -> OptionsT:
    """Validate and return the options of a kind of detector.

    Raises:
        InputError: An option is missing, unknown or invalid.
    """
    for _, sentence in find_wrong_options(options, config):
        raise InputError(sentence)
    return options.model_validate(config.options)


def find_wrong_class_map(
    config: DetectorConfig, class_map: Mapping[str, str], labels: Collection[str]
) -> OptionFaults:
    """Yield the option `class_map` and an error message if it names a class unknown to the model."""
    unknown = [name for name in class_map if name not in labels]
    if unknown:
        yield (
            "class_map",
            f"class_map of a detector of kind {config.kind} names {', '.join(unknown)}, which the model "
            f"does not know; it knows {', '.join(labels)}",
        )
