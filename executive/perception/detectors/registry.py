"""Finding installed detectors and building those that a cell file asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from executive.cell.config import CameraConfig, DetectorConfig
from executive.cell.protocols import Clock
from executive.cell.workcell import KeyPath
from executive.errors import InputError
from executive.perception.detectors.setting import ClosableDetector, DetectorSetting
from executive.plugins import PluginEntry, registered

GROUP = "executive.detectors"
RATES = frozenset({"misses", "confused", "invented", "jitter"})
"""Keys of the error rates that only a fake detector states."""


def installed() -> dict[str, PluginEntry]:
    """Return the kinds of detectors by name."""
    return registered(GROUP, "kind of detector")


def build_detectors(
    configs: Mapping[str, DetectorConfig], *, camera: CameraConfig, clock: Clock, base: Path, seed: int
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file by name, in its order.

    Args:
        configs: The detectors section of the cell file.
        camera: The camera whose frames they search.
        clock: The run's clock, on which their answers become visible.
        base: Folder that paths in their options start from.
        seed: Seed of whatever is random in them.

    Raises:
        InputError: A kind is not installed, an option is wrong, or one rests on itself.
    """
    kinds = installed()
    built: dict[str, ClosableDetector] = {}
    under_way: list[str] = []

    def build(name: str) -> ClosableDetector:
        if name in built:
            return built[name]
        if name not in configs:
            raise InputError(f'the cell has no detector "{name}"; it has: {", ".join(configs)}')
        if name in under_way:
            raise InputError(f"the detectors {' -> '.join([*under_way, name])} rest on each other")
        kind = configs[name].kind
        if kind not in kinds:
            raise InputError(_not_installed(name, kind, kinds))
        under_way.append(name)
        setting = DetectorSetting(name, camera, clock, base, seed, build)
        built[name] = kinds[kind].load().from_config(configs[name], setting)
        under_way.remove(name)
        return built[name]

    try:
        return {name: build(name) for name in configs}
    except BaseException:
        for detector in built.values():
            detector.close()
        raise


def find_problems(configs: Mapping[str, DetectorConfig], base: Path) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key of the cell file and a sentence for everything that keeps a detector from being built.

    A kind that is not installed, and whatever the kind itself finds: one may have, beside `from_config`,
    a static method `check(config, base, others)` that yields options and sentences, `others` being all
    detectors of the cell. No model is loaded.
    """
    kinds = installed()
    for name, config in configs.items():
        if config.kind not in kinds:
            yield ("detectors", name, "kind"), _not_installed(name, config.kind, kinds)
            continue
        kind = kinds[config.kind].load()
        for key in sorted(RATES & config.model_fields_set) if not getattr(kind, "is_fake", False) else ():
            remedy = "remove the key and run `executive evaluate --cell` with this cell"
            yield ("detectors", name, key), f"error rates of this kind of detector are measured; {remedy}"
        check = getattr(kind, "check", None)
        for option, sentence in check(config, base, configs) if check else ():
            yield ("detectors", name, option), sentence


def known_labels(configs: Mapping[str, DetectorConfig], base: Path) -> dict[str, tuple[str, ...] | None]:
    """Return the classes that each detector of a cell file finds, by the cell's names; loads no model.

    None where that is not known: a kind says it in a static method `labels(config, base)`, if it can.
    """
    kinds = installed()
    labels = {
        name: getattr(kinds[config.kind].load(), "labels", None) if config.kind in kinds else None
        for name, config in configs.items()
    }
    return {name: find(configs[name], base) if find else None for name, find in labels.items()}


def _not_installed(name: str, kind: str, kinds: Mapping[str, PluginEntry]) -> str:
    return (
        f'detector "{name}" is of kind "{kind}", which is not installed; '
        f"installed: {', '.join(sorted(kinds)) or 'none'}"
    )
