"""Pictures of a run, embedded in the page of the report or linked."""

from __future__ import annotations

import base64
from collections.abc import Collection
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from urllib.parse import quote

MAX_EMBEDDED_SIZE = 3_000_000
"""Maximum total size of the embedded pictures, so that the page can be sent by e-mail [bytes]."""


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
    """Return the pictures of a run: the last decision for each object, then all failures by time.

    If the pictures are too large for one page, the first pictures are embedded and the others linked.
    `folder` is the folder `frames` of the run; `items` are the names of all items of the run.
    """
    pictures = sorted(
        (_link_picture(file, items) for file in folder.glob("*.jpg")), key=attrgetter("tick", "file")
    )
    decisions = {picture.item: picture for picture in pictures if picture.item and not picture.reason}
    failures = [picture for picture in pictures if picture.reason]
    free_size = MAX_EMBEDDED_SIZE
    shown_pictures = []
    for picture in (*decisions.values(), *failures):
        file = folder / Path(picture.file).name
        # Base64 encodes 3 bytes as 4 characters.
        if file.stat().st_size * 4 / 3 <= free_size:
            source = "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
            free_size -= len(source)
            picture = replace(picture, source=source)
        shown_pictures.append(picture)
    return shown_pictures


def _link_picture(file: Path, items: Collection[str]) -> Picture:
    """Return a link to a picture, with the information in its file name `<tick>_<item>_<reason>`."""
    path = f"{file.parent.name}/{file.name}"
    tick_text, _, subject = file.stem.partition("_")
    tick = int(tick_text) if tick_text.isdecimal() else 0
    # The name of an item may be the beginning of the name of another item, so long names are tried first.
    for item in sorted(items, key=len, reverse=True):
        if subject == item or subject.startswith(f"{item}_"):
            return Picture(quote(path), path, tick, item, subject.removeprefix(item).removeprefix("_"))
    return Picture(quote(path), path, tick, "", subject)
