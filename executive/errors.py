"""Errors with their exit codes, and text of users and third parties made safe for messages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

MAX_QUOTED = 200
"""Maximum length of a quotation or word in a message [characters]."""
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff]"
)
"""Control characters except tab and line feed, invisible Unicode format characters and line separators, and
lone surrogates."""
_PIECE = re.compile(r'"[^"\n]*"|\S+')
"""A quotation or a word."""


class ExecutiveError(Exception):
    """Base of every error this project raises on purpose; `exit_code` is what the command ends with.

    Args:
        message: What happened; of long quotations it keeps the beginning.
    """

    exit_code = 3

    def __init__(self, message: str = "") -> None:
        super().__init__(shorten_quotations(message))


class InputError(ExecutiveError):
    """Something the user gave is wrong; the text says where, what and what instead."""

    exit_code = 2


class Fault(ExecutiveError):
    """A bug or a broken device: never retried, ends the run with the arm at rest.

    Attributes:
        node: Path of the tree node in which it happened, or "" outside the tree.
    """

    def __init__(self, message: str, node: str = "") -> None:
        super().__init__(message)
        self.node = node


class RecordLost(Fault):
    """The disk does not take the record, or somebody deleted it: the run stops, unexplained otherwise."""


class Unreachable(ExecutiveError):
    """No joint configuration inside the limits brings the tool to a goal; the text says how far off it is."""


class Blocked(ExecutiveError):
    """A motion exists but would come too close to something; the text names the body and the distance."""


class Unavailable(ExecutiveError):
    """A detector gave no usable answer; the text says why."""


class Crowded(Unavailable):
    """A detector found more boxes than there can be objects."""


class DeadlinePassed(Unavailable):
    """A detector's time for an answer was over before it came."""


class NoDepth(ExecutiveError):
    """A detection could not be localized because the frame has no usable depth there."""


class Stopped(BaseException):
    """Somebody wanted the run to end while the operator was being asked, and there will be no answer.

    No `except Exception` of a skill catches it: the run is halted, and nothing failed.
    """


def reason_of(error: OSError) -> str:
    """Return why the operating system refused something, in lower case as within a sentence."""
    return (error.strerror or str(error)).lower()


@contextmanager
def explained(kind: type[ExecutiveError], what: str, then: str = "") -> Iterator[None]:
    """Raise what the operating system refuses as an error of a kind.

    Args:
        kind: The kind.
        what: What could not be done.
        then: What follows from that, or what to do; "" for nothing.
    """
    try:
        yield
    except OSError as error:
        raise kind(f"{what}: {reason_of(error)}" + (f"; {then}" if then else "")) from error


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
