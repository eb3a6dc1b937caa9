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
"""Period at which `TerminalOperator` checks for requests in a browser and for a stop of the run [s]."""


class ScriptedOperator:
    """Operator that gives the requests in a list, then quits; emits an event for each request.

    Args:
        requests: Texts that `parse_request` accepts.
        choices: Classes that can be requested.
        emit: Function that emits an event.
        index: Index of the first request; larger than 0 in a resumed run.

    Raises:
        InputError: A request is invalid.
    """

    def __init__(self, requests: Sequence[str], choices: Sequence[str], emit: Emit, index: int = 0) -> None:
        for text in requests:
            if parse_request(text, choices) == "":
                raise InputError(f'cannot pick "{text}"; ask for one of: {", ".join(choices)}')
        self._requests = list(requests)[index:]
        self._emit = emit

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request, or None at the end of the list."""
        request = parse_request(self._requests.pop(0), choices) if self._requests else None
        self._emit(RequestGiven(request))
        return request


class TerminalOperator:
    """Operator at the terminal; the clock of the run stands still until the operator answers a question.

    Args:
        emit: Function that emits an event.
        control: Control of the run, which also passes requests from other sources, such as a browser.
        has_keyboard: True if requests come from standard input; otherwise all requests come from `control`.
    """

    def __init__(self, emit: Emit, control: RunControl, *, has_keyboard: bool = True) -> None:
        self._emit = emit
        self._control = control
        self._has_keyboard = has_keyboard

    def ask(self, choices: Sequence[str]) -> str | None:
        """Ask for a request; return a class, `rescan`, or None for `q` or the end of the input.

        Raises:
            Stopped: The run was stopped before a request.
        """
        # A request that was given before this question, for instance by a second click, must have no effect.
        while self._control.take_request() is not None:
            pass
        self._emit(OperatorAsked(list(choices)))
        menu = "  ".join(f"{number} {label}" for number, label in enumerate(choices))
        while True:
            if self._has_keyboard:
                sys.stderr.write(f"pick what?  {menu}  s rescan  q quit > ")
                sys.stderr.flush()
            line = self._read_line()
            request = parse_request(line.strip(), choices) if line else None
            if request != "":
                self._emit(RequestGiven(request))
                return request
            sys.stderr.write(f'cannot pick "{line.strip()}"\n')

    def _read_line(self) -> str:
        """Wait for the next request, and return its text; "" if the input of the terminal has ended."""
        while not self._control.is_stopped:
            if (text := self._control.take_request()) is not None:
                sys.stderr.write("\n" if self._has_keyboard else "")
                # An empty text would mean the end of the input.
                return text or "?"
            if not self._has_keyboard:
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
