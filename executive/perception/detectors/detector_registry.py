"""Installed kinds of detectors, their options, and construction of the detectors of a cell file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from executive.cell.config import DetectorConfig
from executive.cell.device_config import CameraConfig, Section
from executive.cell.frame import Detection, Frame
from executive.errors import InputError
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


class DetectorKind(Protocol):
    """A kind of detector: the search of frames.

    Each entry point of the group `executive.detectors` is a class with this method and with a class method
    `from_config(config, context)`, which raises InputError if the detector cannot be built. `CellDetector`
    adds thread, latency, error rates and validation of the boxes. Optional members:

    * `close()`: ends a running search, and releases processes, connections and files
    * `check(config, base, all_configs)`: static, see `find_detector_errors`
    * `labels(config, base)`: static, see `find_detectable_labels`
    * `weights(config, base)`: static, returns the path of the model file; a measurement holds for its content
    * `is_fake`: True if the error rates in the cell file are exact, so that they need not be measured
    * `is_instant`: True if a search takes less than a millisecond, so that it needs no thread
    """

    def detect(self, frame: Frame, view: str) -> Sequence[Detection]:
        """Search a view of a frame, `table` (the workspace) or `full`; return the detections, best first.

        The method runs in a thread beside the control loop, and may wait for its result. It runs in two
        threads at once if another detector of the cell is based on this one.

        Raises:
            Unavailable: A server or another program failed; other exceptions are faults and end the run.
            Crowded: There are more boxes than objects fit into the cell.
            DeadlinePassed: A server was late.
        """


@dataclass(frozen=True)
class DetectorContext:
    """Parts of the cell that a kind of detector uses.

    Attributes:
        name: Name of the detector in the cell file.
        camera: The camera whose frames the detector searches.
        cell_folder: Folder of the cell file, to which paths in options are relative.
        seed: Random seed of the detector.
        get_detector: Function that returns a detector of the cell by name; the caller must not close it.
    """

    name: str
    camera: CameraConfig
    cell_folder: Path
    seed: int
    get_detector: Callable[[str], DetectorKind]


KindMaker: TypeAlias = Callable[[DetectorConfig, DetectorContext], DetectorKind]
"""Returns the detector of a section of a cell file."""


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


def load_kind(name: str, config: DetectorConfig, kinds: Mapping[str, PluginEntry]) -> Any:
    """Return the class of the kind of the detector `name`; `kinds` are the installed kinds.

    Raises:
        InputError: The kind is not installed, cannot be loaded, or has no method `detect`.
    """
    start = f'detector "{name}" is of kind "{config.kind}", which'
    if config.kind not in kinds:
        raise InputError(f"{start} is not installed; installed: {', '.join(sorted(kinds)) or 'none'}")
    kind_class = kinds[config.kind].load()
    if not hasattr(kind_class, "detect"):
        advice = "replace `request` by `detect(frame, view)`, which waits and returns a list of detections"
        raise InputError(f"{start} has no method `detect` ({kinds[config.kind].value}); {advice}")
    return kind_class


def make_installed_kind(config: DetectorConfig, context: DetectorContext) -> DetectorKind:
    """Return the detector of a section of a cell file, of its installed kind.

    Raises:
        InputError: The kind is not installed, or an option is invalid.
    """
    kind: DetectorKind = load_kind(context.name, config, find_detector_kinds()).from_config(config, context)
    return kind


def build_kinds(
    configs: Mapping[str, DetectorConfig], *, camera: CameraConfig, cell_folder: Path, seed: int,
    make_kind: KindMaker = make_installed_kind,
) -> dict[str, DetectorKind]:  # fmt: skip
    """Return what searches the frames for each detector of a cell file, in the order of the file.

    Args:
        configs: The section `detectors` of the cell file.
        camera: The camera whose frames the detectors search.
        cell_folder: Folder of the cell file.
        seed: Random seed of the detectors.
        make_kind: Makes the kind of each detector.

    Raises:
        InputError: A kind is not installed, an option is invalid, or a detector depends on itself.
    """
    built: dict[str, DetectorKind] = {}

    def build(dependents: tuple[str, ...], name: str) -> DetectorKind:
        if name in built:
            return built[name]
        if name not in configs:
            raise InputError(f'the cell has no detector "{name}"; it has: {", ".join(configs)}')
        if name in dependents:
            raise InputError(f"the detectors {' -> '.join([*dependents, name])} depend on each other")
        get_detector = partial(build, (*dependents, name))
        context = DetectorContext(name, camera, cell_folder, seed, get_detector)
        built[name] = make_kind(configs[name], context)
        return built[name]

    try:
        return {name: build((), name) for name in configs}
    except BaseException:
        for kind in built.values():
            close_kind(kind)
        raise


def close_kind(kind: DetectorKind) -> None:
    """Release the resources of a kind that has a method `close`."""
    if close := getattr(kind, "close", None):
        close()


def find_detector_errors(configs: Mapping[str, DetectorConfig], base: Path) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of each error in the sections of the detectors.

    A kind may check its options in a static method `check(config, base, all_configs)`: `base` is the folder
    of the cell file, and `all_configs` are the sections of all detectors of the cell.
    """
    kinds = find_detector_kinds()
    for name, config in configs.items():
        try:
            kind = load_kind(name, config, kinds)
        except InputError as error:
            yield ("detectors", name, "kind"), str(error)
            continue
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
