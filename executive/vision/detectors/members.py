"""Detectors that ask others of their cell: what is wrong with whom they name, and what those find."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from executive.cell_config import DetectorConfig, Section
from executive.vision.detectors.options import wrong_options
from executive.vision.detectors.registry import labels_of

FIGURES = ("threshold", "floor", "misses", "confused", "invented", "jitter")
"""Keys of every detector that mean nothing for one that asks others: they are its members' own."""


def wrong_members(
    options: type[Section], config: DetectorConfig, others: Mapping[str, DetectorConfig], no_figure: str
) -> Iterator[tuple[str, str]]:
    """Yield every option because of which a detector that asks others could not be built, with a sentence.

    Args:
        options: What its kind has to know; `detectors` are its members.
        config: Its section of the cell file.
        others: All detectors of its cell, itself among them.
        no_figure: Sentence about a key of `FIGURES`, with `{}` in its place.
    """
    wrong = list(wrong_options(options, config))
    yield from wrong
    for key in FIGURES:
        if key in config.model_fields_set:
            yield key, no_figure.format(key)
    if any(option == "detectors" for option, _ in wrong):
        return
    members = members_of(config)
    for name in dict.fromkeys(members):
        if name not in others:
            yield "detectors", f'the cell has no detector "{name}"; it has: {", ".join(others)}'
        elif members.count(name) > 1:
            yield "detectors", f'the {config.kind} names "{name}" twice; a detector is asked once'
    ring = _way_back(config, members, others, ())
    if ring:
        yield "detectors", f"the {config.kind} rests on itself: {' -> '.join(ring)}"


def labels_of_members(
    config: DetectorConfig, base: Path, others: Mapping[str, DetectorConfig]
) -> tuple[str, ...] | None:
    """Return what any member finds, by the cell's names; None where one does not say.

    Args:
        config: The section of a detector that asks others, with nothing wrong in it.
        base: Folder that paths in options start from.
        others: All detectors of its cell.
    """
    found: dict[str, None] = {}
    for name in members_of(config):
        labels = labels_of(name, others, base)
        if labels is None:
            return None
        found.update(dict.fromkeys(labels))
    return tuple(found)


def members_of(config: DetectorConfig) -> tuple[str, ...]:
    """Return the names of the detectors that one asks; of one that asks none, or is wrong, none."""
    named = config.options.get("detectors", ())
    return tuple(name for name in named if isinstance(name, str)) if isinstance(named, list | tuple) else ()


def _way_back(
    config: DetectorConfig,
    members: tuple[str, ...],
    others: Mapping[str, DetectorConfig],
    passed: tuple[str, ...],
) -> tuple[str, ...]:
    """Return the names on the way from `members` to the detector `config` itself, () where there is none."""
    for name in members:
        if name in passed or name not in others:
            continue
        if others[name] is config:
            return (*passed, name)
        found = _way_back(config, members_of(others[name]), others, (*passed, name))
        if found:
            return found
    return ()
