"""Finding installed detectors and building those that a cell file asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Protocol

from executive.cell import Clock, Detector
from executive.cell_config import CameraConfig, DetectorConfig
from executive.errors import InputError
from executive.workcell import KeyPath

GROUP = "executive.detectors"


class ClosableDetector(Detector, Protocol):
    """A detector that holds something (a thread, a session) until it is closed."""

    def close(self) -> None:
        """Give everything back; waits for the answer under way."""


def installed() -> dict[str, EntryPoint]:
    """Return the installed kinds of detectors by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def build_detectors(
    configs: Mapping[str, DetectorConfig], *, camera: CameraConfig, clock: Clock, base: Path
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file by name, in its order.

    Args:
        configs: The detectors section of the cell file.
        camera: The camera whose frames they search.
        clock: The run's clock, on which their answers become visible.
        base: Folder that paths in their options start from.

    Raises:
        InputError: A kind is not installed, or an option is wrong.
    """
    kinds = installed()
    built: dict[str, ClosableDetector] = {}
    for name, config in configs.items():
        if config.kind not in kinds:
            raise InputError(_not_installed(name, config.kind, kinds))
        built[name] = kinds[config.kind].load().from_config(config, camera=camera, clock=clock, base=base)
    return built


def wrong_detectors(configs: Mapping[str, DetectorConfig], base: Path) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key of the cell file and a sentence for everything that keeps a detector from being built.

    A kind that is not installed, and whatever the kind itself finds: one may have, beside `from_config`,
    a static method `check(config, base)` that yields options and sentences. No model is loaded.
    """
    kinds = installed()
    for name, config in configs.items():
        if config.kind not in kinds:
            yield ("detectors", name, "kind"), _not_installed(name, config.kind, kinds)
            continue
        check = _offered(kinds[config.kind], "check")
        for option, sentence in check(config, base) if check else ():
            yield ("detectors", name, option), sentence


def known_labels(configs: Mapping[str, DetectorConfig], base: Path) -> dict[str, tuple[str, ...] | None]:
    """Return the classes that each detector of a cell file finds, by the cell's names; loads no model.

    None where that is not known: a kind says it in a static method `labels(config, base)`, if it can.
    """
    kinds = installed()
    asked = {
        name: _offered(kinds[config.kind], "labels") if config.kind in kinds else None
        for name, config in configs.items()
    }
    return {name: labels(configs[name], base) if labels else None for name, labels in asked.items()}


def _offered(kind: EntryPoint, method: str) -> Callable[[DetectorConfig, Path], Any] | None:
    """Return a static method that a kind of detector may have, or None where it has not."""
    found: Callable[[DetectorConfig, Path], Any] | None = getattr(kind.load(), method, None)
    return found


def _not_installed(name: str, kind: str, kinds: Mapping[str, EntryPoint]) -> str:
    return (
        f'detector "{name}" is of kind "{kind}", which is not installed; '
        f"installed: {', '.join(sorted(kinds)) or 'none'}"
    )
