"""The pictures of a run, as a page holds them."""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

ROOM = 3_000_000
"""Bytes of all pictures of a page in all, so that it can be sent by mail; others are linked."""


@dataclass(frozen=True)
class Picture:
    """One picture.

    Attributes:
        source: What an `img` takes: the picture itself, or where there is no room a link to its file.
        file: Its place below the run directory.
        tick: Control step that it is of.
        item: What it is about, or "".
        reason: What went wrong, or "".
        inlined: Whether `source` is the picture itself.
    """

    source: str
    file: str
    tick: int
    item: str
    reason: str
    inlined: bool


@dataclass(frozen=True)
class Pictures:
    """The pictures of a run.

    Attributes:
        decisions: Of the last decision for each object, by object.
        failures: Of what went wrong, in order.
    """

    decisions: Mapping[str, Picture]
    failures: Sequence[Picture]


def pictures(folder: Path, items: Collection[str]) -> Pictures:
    """Return what the folder `frames` of a run holds; decisions are the first to be given room."""
    named = sorted(
        (_named(file, items) for file in folder.glob("*.jpg")), key=lambda each: (each[1], each[0])
    )
    decided = {item: (file, tick) for file, tick, item, reason in named if item and not reason}
    failed = [each for each in named if each[3]]
    room = ROOM
    decisions, failures = {}, []
    for item, (file, tick) in decided.items():
        decisions[item] = _picture(file, tick, item, "", room)
        room -= _size(decisions[item])
    for file, tick, item, reason in failed:
        failures.append(_picture(file, tick, item, reason, room))
        room -= _size(failures[-1])
    return Pictures(decisions, failures)


def _named(file: Path, items: Collection[str]) -> tuple[Path, int, str, str]:
    """Return a file with what its name says: tick, object and reason."""
    tick, _, rest = file.stem.partition("_")
    number = int(tick) if tick.isdecimal() else 0
    for item in sorted(items, key=len, reverse=True):
        if rest == item:
            return file, number, item, ""
        if rest.startswith(f"{item}_"):
            return file, number, item, rest.removeprefix(f"{item}_")
    return file, number, "", rest


def _picture(file: Path, tick: int, item: str, reason: str, room: int) -> Picture:
    place = f"{file.parent.name}/{file.name}"
    if 4 * file.stat().st_size / 3 > room:
        return Picture(quote(place), place, tick, item, reason, False)
    data = base64.b64encode(file.read_bytes()).decode()
    return Picture(f"data:image/jpeg;base64,{data}", place, tick, item, reason, True)


def _size(picture: Picture) -> int:
    return len(picture.source) if picture.inlined else 0
