"""Text in drawings and pages: estimated length, truncation, and templates with escaping."""

from __future__ import annotations

import re
import textwrap
import unicodedata

from jinja2 import Environment, PackageLoader, StrictUndefined

_INVALID_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

# Advance widths [fraction of the font size] of characters in DejaVu Sans, the widest common sans-serif font.
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
    """Return an upper bound of the width [pixel] of a text in a sans-serif font; `size` is in pixels."""
    advances = sum(
        1.05 if unicodedata.east_asian_width(character) in "WF" else _ADVANCE.get(character, _DEFAULT_ADVANCE)
        for character in text
    )
    return advances * size * (_BOLD_FACTOR if bold else 1.0)


def fit_text(text: str, max_length: int, max_lines: int = 1) -> tuple[str, ...]:
    """Return a text as at most `max_lines` lines of at most `max_length` characters.

    Lines are broken after commas if possible; `…` replaces the rest of a longer text.
    """
    lines: list[str] = []
    for clause in " ".join(text.split()).replace(", ", ",\n").splitlines():
        if lines and len(lines[-1]) + len(clause) < max_length:
            lines[-1] += f" {clause}"
        else:
            lines += textwrap.wrap(clause, max_length, break_on_hyphens=False)
    if len(lines) > max_lines:
        last = lines[max_lines - 1]
        end = f"{last} …" if len(last) + 2 <= max_length else f"{last[: max_length - 1]}…"
        lines[max_lines - 1 :] = [end]
    return tuple(lines)


def replace_invalid_characters(text: str) -> str:
    """Return a text in which `�` replaces all characters that XML does not allow."""
    return _INVALID_IN_XML.sub("�", text)


def render_template(template: str, **values: object) -> str:
    """Return a rendered template of this package; `template` is its path relative to the package.

    Texts are escaped, and characters that XML does not allow are replaced.
    """
    environment = Environment(
        loader=PackageLoader("executive.view", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return replace_invalid_characters(environment.get_template(template).render(values))
