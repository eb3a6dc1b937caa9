"""Operators: a list of requests, or a person at the terminal."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Sequence

from executive.errors import InputError, Stopped
from executive.events import Emit, OperatorAsked, RequestGiven
from executive.run.run_control import RunControl

RESCAN = "rescan"
KEYBOARD_POLL_PERIOD = 0.1
"""Time between two checks whether the run has to halt, while the operator is asked [s]."""


class ScriptedOperator:
    """Operator that gives the requests of a list, then quits; each request is emitted as an event.

    Args:
        requests: The list.
        choices: Classes that can be requested.
        emit: Takes the events.
        served: Number of requests of the list that were given before an interruption of the run.

    Raises:
        InputError: A request names none of the `choices`.
    """

    def __init__(self, requests: Sequence[str], choices: Sequence[str], emit: Emit, served: int = 0) -> None:
        for word in requests:
            if interpret(word, choices) == "":
                raise InputError(f'cannot pick "{word}"; ask for one of: {", ".join(choices)}')
        self._requests = list(requests)[served:]
        self._emit = emit

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request, or None at the end of the list."""
        answer = interpret(self._requests.pop(0), choices) if self._requests else None
        self._emit(RequestGiven(answer))
        return answer


class TerminalOperator:
    """Operator at the terminal; the clock of the run stands still during a question, and Ctrl-C works.

    Args:
        emit: Takes the events.
        control: Control of the run, which also gives answers from other sources, such as a browser.
        keyboard: True if a person can type at the terminal; otherwise only `control` gives answers.
    """

    def __init__(self, emit: Emit, control: RunControl, *, keyboard: bool = True) -> None:
        self._emit, self._control, self._keyboard = emit, control, keyboard

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the typed class, `rescan`, or None for `q` or the end of the input.

        Raises:
            Stopped: The run has to halt.
        """
        # An answer from before the question, such as a second click, must have no effect.
        while self._control.take_request() is not None:
            pass
        self._emit(OperatorAsked(list(choices)))
        numbered = "  ".join(f"{number} {label}" for number, label in enumerate(choices))
        while True:
            if self._keyboard:
                sys.stderr.write(f"pick what?  {numbered}  s rescan  q quit > ")
                sys.stderr.flush()
            line = self._read_line()
            answer = interpret(line.strip(), choices) if line else None
            if answer != "":
                self._emit(RequestGiven(answer))
                return answer
            sys.stderr.write(f'cannot pick "{line.strip()}"\n')

    def _read_line(self) -> str:
        while not self._control.stopped:
            if (word := self._control.take_request()) is not None:
                sys.stderr.write("\n" if self._keyboard else "")
                return word or "?"
            if not self._keyboard:
                time.sleep(KEYBOARD_POLL_PERIOD)
            elif select.select([sys.stdin], [], [], KEYBOARD_POLL_PERIOD)[0]:
                return sys.stdin.readline()
        raise Stopped("the run has to halt, and nothing was requested")


def interpret(word: str, choices: Sequence[str]) -> str | None:
    """Return the meaning of a typed word: a class, `rescan`, None for `q`, or "" if it has no meaning."""
    word = word.lower()
    if word in ("q", "quit"):
        return None
    if word in ("s", RESCAN):
        return RESCAN
    if word.isdecimal() and int(word) < len(choices):
        return choices[int(word)]
    return next((label for label in choices if label.lower() == word), "")
