"""What only one kind of detector needs to know: the further keys of its section of a cell file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TypeVar

from pydantic import ValidationError

from executive.cell.config import DetectorConfig, Section
from executive.errors import InputError

OptionFaults = Iterator[tuple[str, str]]
"""Options of a detector because of which it cannot be built, each with a sentence."""
OptionsT = TypeVar("OptionsT", bound=Section)


def find_wrong_options(options: type[Section], config: DetectorConfig) -> OptionFaults:
    """Yield every option of a kind of detector that is missing, unknown or wrong, with a sentence."""
    try:
        options.model_validate(config.options)
    except ValidationError as error:
        known = ", ".join(options.model_fields) or "none"
        named = set()
        for problem in error.errors():
            option = str(problem["loc"][0])
            if option in named:  # A value that is of none of several types has an error for each.
                continue
            named.add(option)
            place = ".".join(str(part) for part in problem["loc"])
            yield (
                option,
                f'option "{place}" of a detector of kind {config.kind}: {problem["msg"].lower()}; '
                f"its options: {known}",
            )


def read_options(options: type[OptionsT], config: DetectorConfig) -> OptionsT:
    """Return the options of a kind of detector, checked.

    Raises:
        InputError: An option is missing, unknown or wrong.
    """
    for _, sentence in find_wrong_options(options, config):
        raise InputError(sentence)
    return options.model_validate(config.options)


def find_wrong_class_map(
    config: DetectorConfig, class_map: Mapping[str, str], labels: Collection[str]
) -> OptionFaults:
    """Yield the option `class_map` and a sentence if it names a class that the model does not know."""
    strangers = [name for name in class_map if name not in labels]
    if strangers:
        yield (
            "class_map",
            f"class_map of a detector of kind {config.kind} names {', '.join(strangers)}, which the model "
            f"does not know; it knows {', '.join(labels)}",
        )
