"""Options of the kinds of detectors in the cell file, and their validation."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from executive.cell.config import DetectorConfig, Section
from executive.errors import InputError

OptionErrors = Iterator[tuple[str, str]]
"""Names of missing, unknown or invalid options of a detector, each with an error message."""
OptionsT = TypeVar("OptionsT", bound="DetectorOptions")
"""Class with the options of one kind of detector."""


class DetectorOptions(Section):
    """Base class of the options of one kind of detector."""

    @classmethod
    def find_errors(cls, config: DetectorConfig) -> OptionErrors:
        """Yield each missing, unknown or invalid option in the section `config`, with an error message."""
        try:
            cls.model_validate(config.options)
        except ValidationError as error:
            option_names = ", ".join(cls.model_fields) or "none"
            problems: dict[str, ErrorDetails] = {}
            for problem in error.errors():  # pydantic reports one error for each allowed type of an option.
                problems.setdefault(str(problem["loc"][0]), problem)
            for option, problem in problems.items():
                key_path = ".".join(map(str, problem["loc"]))
                place = f'option "{key_path}" of a detector of kind {config.kind}'
                yield option, f"{place}: {problem['msg'].lower()}; the options are {option_names}"

    @classmethod
    def read(cls: type[OptionsT], config: DetectorConfig) -> OptionsT:
        """Validate and return the options in the section `config` of a detector.

        Raises:
            InputError: An option is missing, unknown or invalid.
        """
        for _, message in cls.find_errors(config):
            raise InputError(message)
        return cls.model_validate(config.options)


def find_class_map_errors(
    config: DetectorConfig, class_map: Mapping[str, str], labels: Collection[str]
) -> OptionErrors:
    """Yield the option `class_map` with an error message if the model lacks a class of `class_map`."""
    if unknown_classes := [name for name in class_map if name not in labels]:
        problem = f"contains {', '.join(unknown_classes)}, which the model cannot find"
        classes = f"the classes of the model are {', '.join(labels)}"
        yield "class_map", f"class_map of a detector of kind {config.kind} {problem}; {classes}"
