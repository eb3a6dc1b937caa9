"""Pictures of a run for its report, which are embedded in the page or linked."""

from __future__ import annotations

import base64
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

MAX_EMBEDDED_SIZE = 3_000_000
"""Maximum total size of the embedded pictures of a page, so that the page can be sent by e-mail [bytes]."""


@dataclass(frozen=True)
class Picture:
    """Picture of a decision or a failure in a run.

    Attributes:
        source: Value of the attribute `src` of an `img` element: the embedded picture, or a link to its file.
        file: Path of the file, relative to the run directory.
        tick: Control step of the picture.
        item: Name of the object in the picture, or "".
        reason: Reason of the failure; "" for a decision.
    """

    source: str
    file: str
    tick: int
    item: str
    reason: str


def collect_pictures(folder: Path, items: Collection[str]) -> list[Picture]:
    """Return the pictures in the folder `frames` of a run, given the names of the items of the run.

    The pictures of the last decision for each object come first and are embedded first; the pictures of
    failures follow in the order of time.
    """
    parsed = sorted(
        (_parse_name(file, items) for file in folder.glob("*.jpg")), key=lambda entry: (entry[1], entry[0])
    )
    decisions = {item: (file, tick, item, "") for file, tick, item, reason in parsed if item and not reason}
    free_size = MAX_EMBEDDED_SIZE
    pictures = []
    for file, tick, item, reason in [*decisions.values(), *(entry for entry in parsed if entry[3])]:
        path = f"{file.parent.name}/{file.name}"
        source = quote(path)
        if 4 * file.stat().st_size / 3 <= free_size:
            source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            free_size -= len(source)
        pictures.append(Picture(source, path, tick, item, reason))
    return pictures


def _parse_name(file: Path, items: Collection[str]) -> tuple[Path, int, str, str]:
    """Return a file, and the control step, object and reason from its name `<tick>_<item>_<reason>`."""
    tick, _, rest = file.stem.partition("_")
    number = int(tick) if tick.isdecimal() else 0
    for item in sorted(items, key=len, reverse=True):
        if rest == item:
            return file, number, item, ""
        if rest.startswith(f"{item}_"):
            return file, number, item, rest.removeprefix(f"{item}_")
    return file, number, "", rest
