"""Error classes, exit codes, and functions for the texts of error messages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum

MAX_QUOTATION_LENGTH = 200
"""Maximum length of a quotation or word in a message [characters]."""
MAX_TEXT_LENGTH = 10_000
"""Maximum length of a text in an event [characters]."""
_CONTROL_CHARACTER = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff]"
)
"""Control characters except tab and line feed, invisible Unicode format characters, Unicode line separators,
and lone surrogates."""
_QUOTATION_OR_WORD = re.compile(r'"[^"\n]*"|\S+')
"""A quotation in double quotes within one line, or a word; `shorten_quotations` shortens the matches."""


class ExitCode(IntEnum):
    """Exit code of a command; a command that executes a run returns the code of the status of the run."""

    SUCCESS = 0
    FAILURE = 1  # also if the ledger differs from the true state of the simulator
    INVALID_INPUT = 2
    FAULT = 3
    INCOMPLETE = 4
    HALTED = 130


class ExecutiveError(Exception):
    """Base class of the errors of this project.

    Args:
        message: Description of the error; long quotations are shortened.
    """

    exit_code = ExitCode.FAULT
    """Exit code of a command that ends with the error."""

    def __init__(self, message: str = "") -> None:
        super().__init__(shorten_quotations(message))


class InputError(ExecutiveError):
    """An input of the user is invalid; the message states the place, the problem and a remedy."""

    exit_code = ExitCode.INVALID_INPUT


class Fault(ExecutiveError):
    """A bug or a broken device. A fault ends the run without retries, after the arm has braked to rest.

    Attributes:
        node: Path of the tree node that raised the fault, or "" outside the tree.
    """

    def __init__(self, message: str, node: str = "") -> None:
        super().__init__(message)
        self.node = node


class RecordLost(Fault):
    """The record of the run cannot be written or was deleted; a run without a record has no explanation."""


class Unreachable(ExecutiveError):
    """No joint configuration within the joint limits reaches a goal; the message states the distance."""


class Blocked(ExecutiveError):
    """Every motion to a goal comes too close to an obstacle; the message states obstacle and distance."""


class Unavailable(ExecutiveError):
    """A detector returned no usable answer; the message states the reason."""


class Crowded(Unavailable):
    """A detector found more boxes than the maximum number of objects in a cell."""


class DeadlinePassed(Unavailable):
    """A detector did not answer before its deadline.

    Attributes:
        timeout: Time from the request to the deadline [s].
    """

    def __init__(self, message: str, timeout: float = 0.0) -> None:
        super().__init__(message)
        self.timeout = timeout


class WrongImage(ExecutiveError):
    """A camera returned an image of another size or format than declared."""


class NoDepth(ExecutiveError):
    """A detection cannot be localized, for instance because the depth image has no values in the box."""


class Stopped(BaseException):
    """The run was halted while a skill waited for the operator.

    A halt is not a failure, so `except Exception` in a skill does not catch this exception.
    """


class Finished(BaseException):
    """The mission ends with success at once; the message is the reason why open items are skipped."""


class Interrupted(KeyboardInterrupt):
    """A signal that ends the process at once; a `KeyboardInterrupt` of a skill is a fault like any other."""


class TickOverdue(BaseException):
    """A control step does not end, for instance because of an endless loop in a skill.

    The exception ends the loop also if the loop contains `except Exception`.
    """


def to_text(value: object) -> str:
    """Return the text of any value, without its middle if it is longer than `MAX_TEXT_LENGTH`."""
    try:
        text = str(value)
    except Interrupted:
        raise
    except BaseException:  # The value may be an object of another project.
        return f"a {type(value).__name__} without text"
    half_length = MAX_TEXT_LENGTH // 2
    return text if len(text) <= MAX_TEXT_LENGTH else f"{text[:half_length]}…{text[1 - half_length :]}"


def describe_error(error: BaseException) -> str:
    """Return the message of an error of this project, or the class and the message of another exception."""
    text = to_text(error)
    return text if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {text}"


def describe_os_error(error: OSError) -> str:
    """Return the message of an operating system error in lower case."""
    return (error.strerror or str(error)).lower()


@contextmanager
def explain_os_errors(error_class: type[ExecutiveError], problem: str, advice: str = "") -> Iterator[None]:
    """Convert an OSError in the `with` block to an error with an explanation.

    Args:
        error_class: Class of the raised error.
        problem: Clause about the failed action, for instance `the file cannot be read`.
        advice: Clause with the consequence of the failure or with advice to the user, or "".
    """
    try:
        yield
    except OSError as error:
        message = f"{problem}: {describe_os_error(error)}"
        raise error_class(f"{message}; {advice}" if advice else message) from error


def escape_control_characters(text: str) -> str:
    r"""Return `text` with a JSON escape sequence, such as `\u001b`, in place of each control character."""
    return _CONTROL_CHARACTER.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def shorten_quotations(text: str) -> str:
    """Return `text` in which every quotation and word has at most `MAX_QUOTATION_LENGTH` characters."""

    def shorten(match: re.Match[str]) -> str:
        if len(match[0]) <= MAX_QUOTATION_LENGTH:
            return match[0]
        ellipsis = '…"' if match[0].startswith('"') and match[0].endswith('"') else "…"
        return match[0][: MAX_QUOTATION_LENGTH - len(ellipsis)] + ellipsis

    return _QUOTATION_OR_WORD.sub(shorten, text)
