"""Text from files, servers and third-party code, made safe for messages and terminals."""

from __future__ import annotations

import re

MAX_QUOTED = 200
"""Maximum length of a quotation or word in a message [characters]."""
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff]"
)
"""Control characters except tab and line feed, invisible Unicode format characters and line separators, and
lone surrogates."""
_PIECE = re.compile(r'"[^"\n]*"|\S+')
"""A quotation or a word."""


def escape_control_characters(text: str) -> str:
    r"""Return `text` with control characters written as in JSON, for instance `\u001b`."""
    return _CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def shorten_quotations(text: str) -> str:
    """Return `text` with every quotation and word cut to `MAX_QUOTED` characters."""
    return _PIECE.sub(lambda match: _shorten(match[0]), text)


def _shorten(piece: str) -> str:
    if len(piece) <= MAX_QUOTED:
        return piece
    end = '…"' if piece[0] == piece[-1] == '"' else "…"
    return piece[: MAX_QUOTED - len(end)] + end
