"""Inputs of a detector: parts of the cell and of the run, and options in the cell file."""

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

OptionErrors = Iterator[tuple[str, str]]
"""Names of missing, unknown or invalid options of a detector, each with an error message."""
OptionsT = TypeVar("OptionsT", bound=Section)
"""Class with the options of one kind of detector."""


class ClosableDetector(Detector, Protocol):
    """A detector that holds resources, such as a thread, until it is closed."""

    def close(self) -> None:
        """Wait for the running search, then release all resources."""


@dataclass(frozen=True)
class DetectorSetting:
    """Parts of the cell and of the run that a detector uses.

    Attributes:
        name: Name of the detector in the cell file.
        camera: The camera whose frames the detector searches.
        clock: Clock of the run, which determines when answers become available.
        base: Folder to which paths in options are relative.
        seed: Random seed of the detector.
        get_detector: Function that returns a detector of the cell by name; the caller must not close it.
    """

    name: str
    camera: CameraConfig
    clock: Clock
    base: Path
    seed: int
    get_detector: Callable[[str], Detector]


def find_option_errors(options: type[Section], config: DetectorConfig) -> OptionErrors:
    """Yield each missing, unknown or invalid option in the section of a detector, with an error message."""
    try:
        options.model_validate(config.options)
    except ValidationError as error:
        option_names = ", ".join(options.model_fields) or "none"
        problems: dict[str, ErrorDetails] = {}
        for problem in error.errors():  # pydantic reports one error for each allowed type of an option.
            problems.setdefault(str(problem["loc"][0]), problem)
        for option, problem in problems.items():
            key_path = ".".join(map(str, problem["loc"]))
            yield (
                option,
                f'option "{key_path}" of a detector of kind {config.kind}: {problem["msg"].lower()}; '
                f"the options are {option_names}",
            )


def read_options(options: type[OptionsT], config: DetectorConfig) -> OptionsT:
    """Validate and return the options in the section of a detector.

    Raises:
        InputError: An option is missing, unknown or invalid.
    """
    for _, message in find_option_errors(options, config):
        raise InputError(message)
    return options.model_validate(config.options)


def find_class_map_errors(
    config: DetectorConfig, class_map: Mapping[str, str], labels: Collection[str]
) -> OptionErrors:
    """Yield the option `class_map` with an error message if the model lacks a class of `class_map`."""
    unknown = [name for name in class_map if name not in labels]
    if unknown:
        yield (
            "class_map",
            f"class_map of a detector of kind {config.kind} contains {', '.join(unknown)}, which the model "
            f"cannot find; the classes of the model are {', '.join(labels)}",
        )
