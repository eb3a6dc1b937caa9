"""Keys pressed at the terminal a run is watched in."""

from __future__ import annotations

import os
import pty
import termios
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from executive.run.operator import RunControl
from executive.view.terminal import KeyReader

PATIENCE = 10.0


@dataclass
class Keyboard:
    """A terminal whose keys a test presses."""

    master: int
    file: int
    control: RunControl
    keys: KeyReader

    def press(self, text: str, paused: bool) -> None:
        """Press keys, and wait until the run is paused or goes on."""
        os.write(self.master, text.encode())
        end = time.monotonic() + PATIENCE
        while self.control.is_paused is not paused:
            assert time.monotonic() < end, f"{text!r} had no effect"
            time.sleep(0.005)

    @property
    def reads_lines(self) -> bool:
        return bool(termios.tcgetattr(self.file)[tty.LFLAG] & termios.ICANON)


@pytest.fixture
def keyboard() -> Iterator[Keyboard]:
    master, file = pty.openpty()
    control = RunControl()
    keys = KeyReader(file, control)
    keys.start()
    yield Keyboard(master, file, control, keys)
    keys.stop()
    os.close(master)
    os.close(file)


def test_a_key_pauses_the_run_and_lets_it_go_on_and_others_mean_nothing(keyboard: Keyboard) -> None:
    keyboard.press("xqé\n\tp", True)
    assert keyboard.control.take_emptied_bins() == []
    keyboard.press("e ", False)
    assert keyboard.control.take_emptied_bins() == [[]], "all bins"
    keyboard.press("p", True)


def test_the_keyboard_is_given_back_as_it_was(keyboard: Keyboard) -> None:
    assert not keyboard.reads_lines
    # Ctrl-C is a signal all the while.
    assert termios.tcgetattr(keyboard.file)[tty.LFLAG] & termios.ISIG
    keyboard.keys.stop()
    assert keyboard.reads_lines
    keyboard.keys.stop()
    keyboard.keys.start()
    keyboard.press("p", True)
