"""The person beside the cell: a script's list of requests, or somebody at the terminal."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from executive.errors import InputError, Stopped
from executive.events import Emit

RESCAN = "rescan"
SLICE = 0.1
"""How long a wait for the keyboard lasts before it looks for an interrupt [s]."""


class ScriptedOperator:
    """Asks for what a list says, then quits; every request is recorded.

    Args:
        requests: The list.
        choices: What can be asked for.
        emit: Takes the `request` events.
        served: How many of the list were asked for before, in a run that is taken up again.

    Raises:
        InputError: A request names none of the `choices`.
    """

    def __init__(self, requests: Sequence[str], choices: Sequence[str], emit: Emit, served: int = 0) -> None:
        for word in requests:
            if understood(word, choices) == "":
                raise InputError(f'cannot pick "{word}"; ask for one of: {", ".join(choices)}')
        self._requests = list(requests)[served:]
        self._emit = emit

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request, or None at the end of the list."""
        answer = understood(self._requests.pop(0), choices) if self._requests else None
        self._emit("request", wanted=answer)
        return answer


@dataclass(eq=False)
class TerminalOperator:
    """Asks at the terminal; the run's clock stands still meanwhile, Ctrl-C works.

    Attributes:
        emit: Takes the `asking` and `request` events.
        interrupted: Tells whether the run is to end.
        requested: Returns a word that was asked for elsewhere than at the terminal, once, or None.
        keyboard: Whether somebody can type; otherwise only what is asked for elsewhere is heard.
    """

    emit: Emit
    interrupted: Callable[[], bool]
    requested: Callable[[], str | None] = lambda: None
    keyboard: bool = True

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the class typed, `rescan`, or None for `q` or the end of the input.

        Raises:
            Stopped: The run is to end.
        """
        # An answer to no question, such as a second click, must not pick something later.
        while self.requested() is not None:
            pass
        self.emit("asking", choices=list(choices))
        numbered = "  ".join(f"{number} {label}" for number, label in enumerate(choices))
        while True:
            if self.keyboard:
                sys.stderr.write(f"pick what?  {numbered}  s rescan  q quit > ")
                sys.stderr.flush()
            line = self._line()
            answer = understood(line.strip(), choices) if line else None
            if answer != "":
                self.emit("request", wanted=answer)
                return answer
            sys.stderr.write(f'cannot pick "{line.strip()}"\n')

    def _line(self) -> str:
        while not self.interrupted():
            if (word := self.requested()) is not None:
                sys.stderr.write("\n" if self.keyboard else "")
                return word or "?"
            if not self.keyboard:
                time.sleep(SLICE)
            elif select.select([sys.stdin], [], [], SLICE)[0]:
                return sys.stdin.readline()
        raise Stopped("the run is to end, and nothing was asked for")


def understood(word: str, choices: Sequence[str]) -> str | None:
    """Return what a typed word means: a class, `rescan`, None for `q`; "" if it means nothing."""
    word = word.lower()
    if word in ("q", "quit"):
        return None
    if word in ("s", RESCAN):
        return RESCAN
    if word.isdecimal() and int(word) < len(choices):
        return choices[int(word)]
    return next((label for label in choices if label.lower() == word), "")
