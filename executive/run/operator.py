"""Operators, who request the next class to pick: a list of requests, or a person at the terminal."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Sequence

from executive.errors import InputError, Stopped
from executive.events import Emit, OperatorAsked, RequestGiven
from executive.run.run_control import RunControl

RESCAN = "rescan"
"""Request for a new scan of the table."""
KEYBOARD_POLL_PERIOD = 0.1
"""Period at which an operator that waits for a request checks whether the run was stopped [s]."""


class ScriptedOperator:
    """Operator that gives the requests of a list, then quits; emits an event for each request.

    Args:
        requests: The requests, in the form that `parse_request` accepts.
        choices: Classes that can be requested.
        emit: Emits an event.
        start: Index of the first request to give, larger than 0 in a resumed run.

    Raises:
        InputError: A request is invalid.
    """

    def __init__(self, requests: Sequence[str], choices: Sequence[str], emit: Emit, start: int = 0) -> None:
        for text in requests:
            if parse_request(text, choices) == "":
                raise InputError(f'cannot pick "{text}"; ask for one of: {", ".join(choices)}')
        self._requests = list(requests)[start:]
        self._emit = emit

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request, or None at the end of the list."""
        request = parse_request(self._requests.pop(0), choices) if self._requests else None
        self._emit(RequestGiven(request))
        return request


class TerminalOperator:
    """Operator at the terminal; a question stops the clock of the run, and Ctrl-C stops the run.

    Args:
        emit: Emits an event.
        control: Control of the run, which also gives requests from other sources, such as a browser.
        keyboard: True if a person can type at the terminal; otherwise only `control` gives requests.
    """

    def __init__(self, emit: Emit, control: RunControl, *, keyboard: bool = True) -> None:
        self._emit, self._control, self._keyboard = emit, control, keyboard

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the requested class, `rescan`, or None for `q` or the end of the input.

        Raises:
            Stopped: The run was stopped before a request.
        """
        # A request from before the question, such as a second click, must have no effect.
        while self._control.take_request() is not None:
            pass
        self._emit(OperatorAsked(list(choices)))
        menu = "  ".join(f"{number} {label}" for number, label in enumerate(choices))
        while True:
            if self._keyboard:
                sys.stderr.write(f"pick what?  {menu}  s rescan  q quit > ")
                sys.stderr.flush()
            line = self._read_line()
            request = parse_request(line.strip(), choices) if line else None
            if request != "":
                self._emit(RequestGiven(request))
                return request
            sys.stderr.write(f'cannot pick "{line.strip()}"\n')

    def _read_line(self) -> str:
        while not self._control.is_stopped:
            if (text := self._control.take_request()) is not None:
                sys.stderr.write("\n" if self._keyboard else "")
                return text or "?"
            if not self._keyboard:
                time.sleep(KEYBOARD_POLL_PERIOD)
            elif select.select([sys.stdin], [], [], KEYBOARD_POLL_PERIOD)[0]:
                return sys.stdin.readline()
        raise Stopped("the run was stopped before a request of the operator")


def parse_request(text: str, choices: Sequence[str]) -> str | None:
    """Return the request in a text: a class, `rescan`, None to quit, or "" if the text is invalid.

    Valid texts are a class, its index in `choices`, `s`, `rescan`, `q` and `quit`.
    """
    text = text.lower()
    if text in ("q", "quit"):
        return None
    if text in ("s", RESCAN):
        return RESCAN
    if text.isdecimal() and int(text) < len(choices):
        return choices[int(text)]
    return next((label for label in choices if label.lower() == text), "")
