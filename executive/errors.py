"""Errors with their exit codes, and text of users and third parties made safe for messages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

MAX_QUOTED = 200
"""Maximum length of a quotation or word in a message [characters]."""
_CONTROL_CHARACTER = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff]"
)
"""Control characters except tab and line feed, invisible Unicode format characters and line separators, and
lone surrogates."""
_QUOTATION_OR_WORD = re.compile(r'"[^"\n]*"|\S+')
"""A quotation or a word."""


class ExecutiveError(Exception):
    """Base of the errors of this project.

    Args:
        message: Description of the error; long quotations are shortened.
    """

    exit_code = 3
    """Exit code of a command that ends with the error."""

    def __init__(self, message: str = "") -> None:
        super().__init__(shorten_quotations(message))


class InputError(ExecutiveError):
    """An input of the user is wrong; the text states the place, the problem and the solution."""

    exit_code = 2


class Fault(ExecutiveError):
    """A bug or a broken device: ends the run with the arm at rest, without retries.

    Attributes:
        node: Path of the tree node that raised the fault, or "" outside the tree.
    """

    def __init__(self, message: str, node: str = "") -> None:
        super().__init__(message)
        self.node = node


class RecordLost(Fault):
    """The record of the run cannot be written or was deleted: the run stops, because nothing explains it."""


class Unreachable(ExecutiveError):
    """No joint configuration inside the limits reaches a goal; the text states the excess."""


class Blocked(ExecutiveError):
    """Every motion would come too close to an obstacle; the text names the obstacle and the distance."""


class Unavailable(ExecutiveError):
    """A detector gave no usable answer; the text states the reason."""


class Crowded(Unavailable):
    """A detector found more boxes than objects are possible."""


class DeadlinePassed(Unavailable):
    """A detector did not answer before its deadline."""


class NoDepth(ExecutiveError):
    """A detection could not be localized because the frame has no usable depth there."""


class Stopped(BaseException):
    """The run was stopped while it waited for the operator, so that there will be no answer.

    A halt is no failure: therefore `except Exception` in a skill does not catch this exception.
    """


def describe_os_error(error: OSError) -> str:
    """Return the text of an error of the operating system, in lower case."""
    return (error.strerror or str(error)).lower()


@contextmanager
def explain_os_errors(kind: type[ExecutiveError], problem: str, advice: str = "") -> Iterator[None]:
    """Convert errors of the operating system to errors of a kind.

    Args:
        kind: Class of the raised errors.
        problem: Description of the action that failed.
        advice: Consequence of the failure or advice, or "".
    """
    try:
        yield
    except OSError as error:
        raise kind(f"{problem}: {describe_os_error(error)}" + (f"; {advice}" if advice else "")) from error


def escape_control_characters(text: str) -> str:
    r"""Return `text` with control characters written as in JSON, for instance `\u001b`."""
    return _CONTROL_CHARACTER.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def shorten_quotations(text: str) -> str:
    """Return `text` with every quotation and word shortened to `MAX_QUOTED` characters."""

    def shorten(match: re.Match[str]) -> str:
        piece = match[0]
        end = '…"' if piece.startswith('"') and piece.endswith('"') else "…"
        return piece if len(piece) <= MAX_QUOTED else piece[: MAX_QUOTED - len(end)] + end

    return _QUOTATION_OR_WORD.sub(shorten, text)
