"""Texts of pictures and pages: length, shortening, and templates in which every text is escaped."""

from __future__ import annotations

import re
import textwrap
import unicodedata

from jinja2 import Environment, PackageLoader, StrictUndefined

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

# Advance widths in DejaVu Sans, the widest of the usual sans-serif fonts: no viewer needs more room.
_ADVANCES = {
    0.36: "ijlIJ',./:;\\| ",
    0.42: "frt!()-[]",
    0.54: 'csz"*?_`',
    0.85: "wDGHOQ#&+<=>^~MNU",
    1.0: "mW%@",
}
_ADVANCE = {character: advance for advance, characters in _ADVANCES.items() for character in characters}
_USUAL = 0.64
_BOLD = 1.12


def extent(text: str, size: float, *, bold: bool = False) -> float:
    """Return about how long a text is in a sans-serif font of this size; never too short in usual fonts."""
    advances = sum(
        1.05 if unicodedata.east_asian_width(character) in "WF" else _ADVANCE.get(character, _USUAL)
        for character in text
    )
    return advances * size * (_BOLD if bold else 1.0)


def fitted(text: str, columns: int, lines: int = 1) -> tuple[str, ...]:
    """Return a text in so many lines of so many characters at most, cut behind a comma where it can be.

    What is left out becomes `…`.
    """
    rows: list[str] = []
    for clause in " ".join(text.split()).replace(", ", ",\n").splitlines():
        if rows and len(rows[-1]) + len(clause) < columns:
            rows[-1] += f" {clause}"
        else:
            rows += textwrap.wrap(clause, columns, break_on_hyphens=False)
    if len(rows) > lines:
        last = rows[lines - 1]
        rows[lines - 1 :] = [f"{last} …" if len(last) + 2 <= columns else f"{last[: columns - 1]}…"]
    return tuple(rows)


def writable(text: str) -> str:
    """Return a text with the replacement character for whatever XML cannot hold."""
    return _NOT_XML.sub("�", text)


def render(template: str, **values: object) -> str:
    """Return a template of this package, filled in; texts are escaped, and replaced where XML lacks them."""
    environment = Environment(
        loader=PackageLoader("executive.view", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return writable(environment.get_template(template).render(values))
