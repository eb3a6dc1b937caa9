"""Images of decisions and failures of a run, for the report."""

from __future__ import annotations

import base64
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

MAX_EMBEDDED_SIZE = 3_000_000
"""Total size of embedded images, small enough for an e-mail [bytes]; further images are linked."""


@dataclass(frozen=True)
class Picture:
    """One image of a run.

    Attributes:
        source: Source of an `img` element: the embedded image, or a link to its file.
        file: Its path below the run directory.
        tick: Control step of the image.
        item: Object of the decision or failure, or "".
        reason: Reason of the failure, or "".
    """

    source: str
    file: str
    tick: int
    item: str
    reason: str


def pictures(folder: Path, items: Collection[str]) -> list[Picture]:
    """Return the images in the folder `frames` of a run.

    First come the images of the last decision for each object, which have no reason and are embedded first,
    then those of failures in their order.
    """
    parsed = sorted(
        (_parse_name(file, items) for file in folder.glob("*.jpg")), key=lambda entry: (entry[1], entry[0])
    )
    decided = {item: (file, tick, item, "") for file, tick, item, reason in parsed if item and not reason}
    free_size = MAX_EMBEDDED_SIZE
    found = []
    for file, tick, item, reason in [*decided.values(), *(entry for entry in parsed if entry[3])]:
        path = f"{file.parent.name}/{file.name}"
        source = quote(path)
        if 4 * file.stat().st_size / 3 <= free_size:
            source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            free_size -= len(source)
        found.append(Picture(source, path, tick, item, reason))
    return found


def _parse_name(file: Path, items: Collection[str]) -> tuple[Path, int, str, str]:
    """Return a file with the parts of its name: tick, object and reason."""
    tick, _, rest = file.stem.partition("_")
    number = int(tick) if tick.isdecimal() else 0
    for item in sorted(items, key=len, reverse=True):
        if rest == item:
            return file, number, item, ""
        if rest.startswith(f"{item}_"):
            return file, number, item, rest.removeprefix(f"{item}_")
    return file, number, "", rest
