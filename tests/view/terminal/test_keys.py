"""Keys pressed at the terminal a run is watched in."""

from __future__ import annotations

import os
import pty
import termios
import threading
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from executive.runtime.run_control import RunControl
from executive.view.terminal.keys import Keys

PATIENCE = 10.0


@dataclass
class Keyboard:
    """A terminal whose keys a test presses."""

    master: int
    file: int
    control: RunControl
    keys: Keys
    pressed: threading.Semaphore

    def press(self, text: str, meant: int) -> None:
        """Press keys, and wait until as many of them as meant something were told."""
        os.write(self.master, text.encode())
        for _ in range(meant):
            assert self.pressed.acquire(timeout=PATIENCE), f"nobody heard {text!r}"

    @property
    def reads_lines(self) -> bool:
        return bool(termios.tcgetattr(self.file)[tty.LFLAG] & termios.ICANON)


@pytest.fixture
def keyboard() -> Iterator[Keyboard]:
    master, file = pty.openpty()
    control, pressed = RunControl(), threading.Semaphore(0)
    keys = Keys(file, control, pressed.release)
    keys.listen()
    yield Keyboard(master, file, control, keys, pressed)
    keys.leave()
    os.close(master)
    os.close(file)


def test_a_key_pauses_the_run_and_lets_it_go_on(keyboard: Keyboard) -> None:
    keyboard.press("p", 1)
    assert keyboard.control.paused
    keyboard.press(" ", 1)
    assert not keyboard.control.paused


def test_a_key_takes_one_step(keyboard: Keyboard) -> None:
    keyboard.press("s", 1)
    assert keyboard.control.paused
    keyboard.control.wait()
    threading.Timer(0.1, keyboard.control.stop).start()
    keyboard.control.wait()
    assert keyboard.control.stopped


def test_other_keys_mean_nothing(keyboard: Keyboard) -> None:
    keyboard.press("xq\n\tp", 1)
    assert keyboard.control.paused


def test_the_keyboard_is_given_back_as_it_was(keyboard: Keyboard) -> None:
    assert not keyboard.reads_lines
    # Ctrl-C is a signal all the while.
    assert termios.tcgetattr(keyboard.file)[tty.LFLAG] & termios.ISIG
    keyboard.keys.leave()
    assert keyboard.reads_lines
    keyboard.keys.leave()
    keyboard.keys.listen()
    keyboard.press("p", 1)
    assert keyboard.control.paused
