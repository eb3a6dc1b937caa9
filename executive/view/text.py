"""Text in drawings and pages: estimated length, shortening, and templates with escaping."""

from __future__ import annotations

import re
import textwrap
import unicodedata

from jinja2 import Environment, PackageLoader, StrictUndefined

_INVALID_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

# Advance widths [share of the font size] in DejaVu Sans, the widest of the common sans-serif fonts.
_ADVANCES = {
    0.36: "ijlIJ',./:;\\| ",
    0.42: "frt!()-[]",
    0.54: 'csz"*?_`',
    0.85: "wDGHOQ#&+<=>^~MNU",
    1.0: "mW%@",
}
_ADVANCE = {character: advance for advance, characters in _ADVANCES.items() for character in characters}
_DEFAULT_ADVANCE = 0.64
_BOLD_FACTOR = 1.12


def measure_text(text: str, size: float, *, bold: bool = False) -> float:
    """Return an upper bound of the length [pixel] of a text in a sans-serif font of this size [pixel]."""
    advances = sum(
        1.05 if unicodedata.east_asian_width(character) in "WF" else _ADVANCE.get(character, _DEFAULT_ADVANCE)
        for character in text
    )
    return advances * size * (_BOLD_FACTOR if bold else 1.0)


def fit_text(text: str, columns: int, lines: int = 1) -> tuple[str, ...]:
    """Return a text in at most `lines` lines of `columns` characters, preferably broken after a comma.

    The rest of a longer text is replaced by `…`.
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


def replace_invalid(text: str) -> str:
    """Return a text in which `�` replaces the characters that XML does not allow."""
    return _INVALID_IN_XML.sub("�", text)


def render(template: str, **values: object) -> str:
    """Return a rendered template of this package; texts are escaped, and characters outside XML replaced."""
    environment = Environment(
        loader=PackageLoader("executive.view", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return replace_invalid(environment.get_template(template).render(values))
