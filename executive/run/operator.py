"""Control of a run by a person: pause, step, stop, signals, and requests of the operator."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from executive.errors import InputError, Interrupted, Stopped, TickOverdue, shorten_quotations, to_text

if TYPE_CHECKING:
    from executive.events import Emit

PAUSE_POLL_PERIOD = 0.05
"""Period at which a paused run handles signals and calls the callbacks of `call_between_ticks` [s]."""
HALT_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that halt a run, and that end any other command."""


class RunControl:
    """Commands to a run from any thread or signal handler; a command takes effect between two ticks.

    During a pause, the clock of the run and a simulated world stand still.

    Attributes:
        is_stopped: True after the first call of `stop`.
        is_idle: True while `wait_while_paused` has nothing to do.
        is_time_held: True while the run waits for a person.
        hold_time: Function that returns a context in which the clock of the run stands still.
    """

    def __init__(self) -> None:
        self.is_stopped = False
        self.is_idle = True
        self.is_time_held = False
        self.hold_time: Callable[[], AbstractContextManager[None]] = nullcontext
        self._is_paused = False
        self._remaining_ticks = 0
        """Number of ticks that `step` requested and that have not begun."""
        self._wake_up = threading.Event()
        self._requests: deque[str] = deque()
        self._emptied_bins: deque[list[str]] = deque()
        self._callbacks: list[Callable[[], None]] = []

    @property
    def is_paused(self) -> bool:
        """True if the run is paused or will pause after the ticks of `step`; False after `stop`."""
        return self._is_paused and not self.is_stopped

    def stop(self) -> None:
        """Stop the run: the run halts its tree and brakes its arm."""
        self.is_stopped = True
        self._wake_up.set()

    def pause(self) -> None:
        """Pause the run before its next tick."""
        self._is_paused = True
        self.is_idle = False

    def resume(self) -> None:
        """End the pause."""
        self._is_paused = False
        self._remaining_ticks = 0
        self._wake_up.set()

    def step(self, tick_count: int = 1) -> None:
        """Let the run tick `tick_count` times, and then pause the run."""
        # If the run is not paused, no ticks remain, because `resume` sets their number to 0.
        self._remaining_ticks += tick_count
        self._is_paused = True
        self.is_idle = False
        self._wake_up.set()

    def add_request(self, text: str) -> None:
        """Store a request of the operator; `TerminalOperator` ignores requests that precede its question."""
        self._requests.append(text)

    def take_request(self) -> str | None:
        """Remove and return the oldest request; return None if there is no request."""
        return self._requests.popleft() if self._requests else None

    def empty_bins(self, *names: str) -> None:
        """Declare that bins have been emptied, without names all bins; their objects no longer count."""
        self._emptied_bins.append(list(map(to_text, names)))

    def take_emptied_bins(self) -> list[list[str]]:
        """Remove and return the names of the bins of each call of `empty_bins`."""
        return [self._emptied_bins.popleft() for _ in range(len(self._emptied_bins))]

    def call_between_ticks(self, callback: Callable[[], None]) -> None:
        """Call `callback` between any two ticks, and periodically during a pause.

        The callback runs in the thread of the tick loop, may read the cell, and must return at once.
        """
        self._callbacks.append(callback)
        self.is_idle = False

    def wait_while_paused(self) -> None:
        """Call the callbacks; in a pause, wait for `resume` or `stop`, or begin a tick of `step`."""
        while True:
            for callback in self._callbacks:
                callback()
            if not self.is_paused:
                return
            if self._remaining_ticks > 0:
                self._remaining_ticks -= 1
                return
            with self.hold_time():
                self._wake_up.wait(PAUSE_POLL_PERIOD)
            self._wake_up.clear()


@contextmanager
def handle_signals(
    signal_numbers: Sequence[int], handler: Callable[[int, FrameType | None], None]
) -> Iterator[Callable[[], None]]:
    """Handle signals in the `with` block, and yield a function that restores the previous handlers.

    A signal that the process ignores stays ignored (`nohup`), except SIGINT: a waiting worker process ignores
    SIGINT, but SIGINT must halt a run. Python allows no handlers outside the main thread.
    """
    is_main_thread = threading.current_thread() is threading.main_thread()
    with ExitStack() as previous_handlers:
        for number in signal_numbers if is_main_thread else ():
            if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
                previous_handlers.callback(signal.signal, number, signal.signal(number, handler))
        yield previous_handlers.close


def interrupt(number: int, frame: FrameType | None) -> NoReturn:
    """Handle a signal: end the process at once."""
    del number, frame
    raise Interrupted


@contextmanager
def halt_on_signals(control: RunControl) -> Iterator[None]:
    """Stop the run at the first signal; a second signal goes to the handler from before the `with` block."""

    def stop_run(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    with handle_signals(HALT_SIGNALS, stop_run) as restore:
        yield


MAX_TICK_TIME = 60.0
"""Maximum wall time of a control step, in which planner and detectors of a simulated cell may work [s]."""
MAX_HALT_TIME = 5.0
"""Maximum wall time of a control step in which the run is halted [s]."""
TICK_CHECK_PERIOD = 0.5
"""Time between two checks of the wall time of a control step [s]."""


@contextmanager
def limit_tick_time(control: RunControl, get_tick: Callable[[], int]) -> Iterator[None]:
    """Raise `TickOverdue` in a control step that does not end; only in the main thread of a process.

    The limit does not apply while the run waits for a person, under a debugger or another tracer, and in a
    call of native code.

    Args:
        control: Control of the run.
        get_tick: Function that returns the number of the current control step.
    """
    checked_state = (-1, False)
    tick_time = 0.0
    limit = MAX_TICK_TIME

    def check_tick(*_: object) -> None:
        nonlocal checked_state, tick_time, limit
        tick = get_tick()
        state = (tick, control.is_stopped)
        if state != checked_state or control.is_time_held or sys.gettrace() is not None:
            checked_state = state
            tick_time = 0.0
            return
        tick_time += TICK_CHECK_PERIOD
        if tick_time >= (MAX_HALT_TIME if control.is_stopped else limit):
            tick_time = 0.0
            # The skill is halted next, and its `finally` may not end either.
            limit = MAX_HALT_TIME
            raise TickOverdue(f"control step {tick} did not end; a skill must yield in every control step")

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with handle_signals([signal.SIGALRM], check_tick):
        previous_timer = signal.setitimer(signal.ITIMER_REAL, TICK_CHECK_PERIOD, TICK_CHECK_PERIOD)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, *previous_timer)


RESCAN = "rescan"
"""Request for a new scan of the table."""
KEYBOARD_POLL_PERIOD = 0.1
"""Period at which `TerminalOperator` checks for requests in a browser and for a stop of the run [s]."""
MAX_LINE_LENGTH = 1000
"""Length of a line of standard input behind which the rest of the line is ignored [byte]; longer than every
request, so that a cut line is an invalid request."""
MAX_READ_SIZE = 65536
"""Maximum number of bytes that are read from standard input at once."""


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
        from executive.events import RequestGiven  # The import takes 0.3 s, and `--help` imports this file.

        request = parse_request(self._requests.pop(0), choices) if self._requests else None
        self._emit(RequestGiven(request))
        return request


class TerminalOperator:
    """Operator at the terminal; the clock of the run stands still until the operator answers a question.

    Each line of standard input answers one question, also if several lines arrive together.

    Args:
        emit: Function that emits an event.
        control: Control of the run, which also passes requests from other sources, such as a browser.
        has_keyboard: True if requests come from standard input; otherwise all requests come from `control`.
    """

    def __init__(self, emit: Emit, control: RunControl, *, has_keyboard: bool = True) -> None:
        self._emit = emit
        self._control = control
        self._has_keyboard = has_keyboard
        self._input = b""
        """Start of the input that no question has used."""

    def ask(self, choices: Sequence[str]) -> str | None:
        """Ask for a request; return a class, `rescan`, or None for `q` or the end of the input.

        Raises:
            Stopped: The run was stopped before a request.
        """
        from executive.events import OperatorAsked, RequestGiven  # As in `ScriptedOperator.ask`.

        # A request that was given before this question, for instance by a second click, must have no effect.
        while self._control.take_request() is not None:
            pass
        self._emit(OperatorAsked(list(choices)))
        menu = "  ".join(f"{number} {label}" for number, label in enumerate(choices))
        while True:
            if self._has_keyboard:
                sys.stderr.write(f"pick what?  {menu}  s rescan  q quit > ")
                sys.stderr.flush()
            with self._control.hold_time():
                line = self._read_line()
            request = parse_request(line.strip(), choices) if line else None
            if request != "":
                self._emit(RequestGiven(request))
                return request
            sys.stderr.write(shorten_quotations(f'cannot pick "{line.strip()}"\n'))

    def _read_line(self) -> str:
        """Wait for the next request, and return its text; "" if the input of the terminal has ended."""
        while not self._control.is_stopped:
            if (text := self._control.take_request()) is not None:
                sys.stderr.write("\n" if self._has_keyboard else "")
                # An empty text would mean the end of the input.
                return text or "?"
            line, line_end, rest = self._input.partition(b"\n")
            if line_end:
                self._input = rest
                return line[:MAX_LINE_LENGTH].decode(errors="replace") + "\n"
            if not self._has_keyboard:
                time.sleep(KEYBOARD_POLL_PERIOD)
            elif sys.stdin is None or not sys.stdin.readable():
                return ""
            # `select` does not see what an object such as `sys.stdin` has read into its buffer.
            elif select.select([sys.stdin], [], [], KEYBOARD_POLL_PERIOD)[0]:
                data = os.read(sys.stdin.fileno(), MAX_READ_SIZE)
                self._input = line[:MAX_LINE_LENGTH] + data if data else b""
                if not data:
                    return line.decode(errors="replace")
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
    return next((label for index, label in enumerate(choices) if text in (str(index), label.lower())), "")
