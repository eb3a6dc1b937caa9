"""Installed kinds of detectors, their options, and construction of the detectors of a cell file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from executive.cell.config import DetectorConfig
from executive.cell.device_config import CameraConfig, Section
from executive.cell.protocols import Clock
from executive.errors import InputError
from executive.perception.detectors.requests import ClosableDetector, DetectorContext
from executive.plugins import PluginEntry, list_entries
from executive.text.validate import KeyPath

OptionErrors = Iterator[tuple[str, str]]
"""Names of missing, unknown or invalid options of a detector, each with an error message."""
OptionsT = TypeVar("OptionsT", bound="DetectorOptions")
"""Class with the options of one kind of detector."""
DETECTOR_GROUP = "executive.detectors"
"""Entry-point group of kinds of detectors."""
FAKE_ERROR_RATE_KEYS = frozenset({"miss_rate", "confusion_rate", "false_detections", "jitter"})
"""Keys of error rates; only the section of a fake detector may contain them."""


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

    @staticmethod
    def find_class_map_errors(
        config: DetectorConfig, class_map: Mapping[str, str], labels: Collection[str]
    ) -> OptionErrors:
        """Yield the option `class_map` with an error message if the model lacks a class of `class_map`."""
        if unknown_classes := [name for name in class_map if name not in labels]:
            problem = f"contains {', '.join(unknown_classes)}, which the model cannot find"
            classes = f"the classes of the model are {', '.join(labels)}"
            yield "class_map", f"class_map of a detector of kind {config.kind} {problem}; {classes}"


def find_detector_kinds() -> dict[str, PluginEntry]:
    """Return the installed kinds of detectors by name."""
    return list_entries(DETECTOR_GROUP, "kind of detector")


def build_detectors(
    configs: Mapping[str, DetectorConfig], *, camera: CameraConfig, clock: Clock, base: Path, seed: int
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file by name, in the order of the file.

    Args:
        configs: The section `detectors` of the cell file.
        camera: The camera whose frames the detectors search.
        clock: Clock of the run, which determines when answers become available.
        base: Folder of the cell file.
        seed: Random seed of the detectors.

    Raises:
        InputError: A kind is not installed, an option is invalid, or a detector depends on itself.
    """
    kinds = find_detector_kinds()
    detectors: dict[str, ClosableDetector] = {}

    def build(dependents: tuple[str, ...], name: str) -> ClosableDetector:
        if name in detectors:
            return detectors[name]
        if name not in configs:
            raise InputError(f'the cell has no detector "{name}"; it has: {", ".join(configs)}')
        if name in dependents:
            raise InputError(f"the detectors {' -> '.join([*dependents, name])} depend on each other")
        kind = configs[name].kind
        if kind not in kinds:
            raise InputError(_describe_missing_kind(name, kind, kinds))
        get_detector = partial(build, (*dependents, name))
        context = DetectorContext(name, camera, clock, base, seed, get_detector)
        detectors[name] = kinds[kind].load().from_config(configs[name], context)
        return detectors[name]

    try:
        return {name: build((), name) for name in configs}
    except BaseException:
        for detector in detectors.values():
            detector.close()
        raise


def find_detector_errors(configs: Mapping[str, DetectorConfig], base: Path) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of each error in the sections of the detectors.

    A kind may check its options in a static method `check(config, base, all_configs)`: `base` is the folder
    of the cell file, and `all_configs` are the sections of all detectors of the cell.
    """
    kinds = find_detector_kinds()
    for name, config in configs.items():
        if config.kind not in kinds:
            yield ("detectors", name, "kind"), _describe_missing_kind(name, config.kind, kinds)
            continue
        kind = kinds[config.kind].load()
        forbidden_keys = FAKE_ERROR_RATE_KEYS if not getattr(kind, "is_fake", False) else frozenset()
        for key in sorted(forbidden_keys & config.model_fields_set):
            remedy = "remove the key and run `executive evaluate --cell` with this cell"
            yield ("detectors", name, key), f"error rates of this kind of detector are measured; {remedy}"
        check = getattr(kind, "check", None)
        for option, message in check(config, base, configs) if check else ():
            yield ("detectors", name, option), message


def find_detectable_labels(
    configs: Mapping[str, DetectorConfig], base: Path
) -> dict[str, tuple[str, ...] | None]:
    """Return the labels that each detector can find, by name of the detector; None if unknown.

    A kind of detector may return its labels in a static method `labels(config, base)`, which loads no model.
    """
    kinds = find_detector_kinds()
    labels: dict[str, tuple[str, ...] | None] = {}
    for name, config in configs.items():
        find_labels = getattr(kinds[config.kind].load(), "labels", None) if config.kind in kinds else None
        labels[name] = find_labels(config, base) if find_labels else None
    return labels


def _describe_missing_kind(name: str, kind: str, kinds: Mapping[str, PluginEntry]) -> str:
    installed_kinds = ", ".join(sorted(kinds)) or "none"
    return f'detector "{name}" is of kind "{kind}", which is not installed; installed: {installed_kinds}'
