"""Functions for texts in drawings and pages: width estimate, line breaks, and templates."""

from __future__ import annotations

import re
import textwrap

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.cells import cell_len

_INVALID_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Pattern of the characters that XML 1.0 does not allow."""
_CELL_WIDTH = 0.64
"""Width of most characters in DejaVu Sans, the widest common sans-serif font [fraction of the font size]."""
_BOLD_FACTOR = 1.12
"""Ratio of the widths of a bold and a regular character."""


def estimate_text_width(text: str, font_size: float, *, bold: bool = False) -> float:
    """Return the approximate width [pixel] of a text in a sans-serif font of `font_size` [pixel]."""
    return cell_len(text) * _CELL_WIDTH * font_size * (_BOLD_FACTOR if bold else 1.0)


def wrap_and_truncate(text: str, max_length: int, max_lines: int = 1) -> tuple[str, ...]:
    """Return a text as at most `max_lines` lines of at most `max_length` characters.

    Lines are broken after commas if possible. An ellipsis `…` replaces text beyond the last line.
    """
    lines: list[str] = []
    for clause in " ".join(text.split()).replace(", ", ",\n").splitlines():
        if lines and len(lines[-1]) + len(clause) < max_length:
            lines[-1] += f" {clause}"
        else:
            lines += textwrap.wrap(clause, max_length, break_on_hyphens=False)
    if len(lines) > max_lines:
        line = lines[max_lines - 1]
        last_line = f"{line} …" if len(line) + 2 <= max_length else f"{line[: max_length - 1]}…"
        lines[max_lines - 1 :] = [last_line]
    return tuple(lines)


def replace_invalid_xml_characters(text: str) -> str:
    """Return a text in which `�` replaces all characters that XML does not allow."""
    return _INVALID_IN_XML.sub("�", text)


def render_template(template: str, **values: object) -> str:
    """Return a rendered template; escape texts, and replace characters that XML does not allow.

    `template` is the path of the template file, relative to `executive/view`.
    """
    environment = Environment(
        loader=PackageLoader("executive.view", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return replace_invalid_xml_characters(environment.get_template(template).render(values))
