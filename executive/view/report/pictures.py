"""Pictures of a run, for a page that holds them."""

from __future__ import annotations

import base64
from collections.abc import Collection
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
    """

    source: str
    file: str
    tick: int
    item: str
    reason: str


def pictures(folder: Path, items: Collection[str]) -> list[Picture]:
    """Return the pictures in the folder `frames` of a run.

    First come those of the last decision for each object, which have no reason and are the first to be given
    room, then those of failures in their order.
    """
    named = sorted(
        (_named(file, items) for file in folder.glob("*.jpg")), key=lambda each: (each[1], each[0])
    )
    decided = {item: (file, tick, item, "") for file, tick, item, reason in named if item and not reason}
    room = ROOM
    found = []
    for file, tick, item, reason in [*decided.values(), *(each for each in named if each[3])]:
        place = f"{file.parent.name}/{file.name}"
        source = quote(place)
        if 4 * file.stat().st_size / 3 <= room:
            source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            room -= len(source)
        found.append(Picture(source, place, tick, item, reason))
    return found


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
