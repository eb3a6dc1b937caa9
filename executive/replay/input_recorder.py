"""Recorder of the inputs of a run: the values that the run reads from its cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TypeVar

from executive.errors import Stopped
from executive.events import Emit, InputRead
from executive.replay.codecs import IDENTITY, Codec

Value = TypeVar("Value")


class InputRecorder:
    """Emits an event for each changed value of an input; used only in the thread of the tick loop.

    Args:
        emit: Function that emits an event.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._read_counts: Counter[str] = Counter()
        self._last_values: dict[str, object] = {}

    def begin_step(self) -> None:
        """Begin a control step: set the number of reads of each input to 0."""
        self._read_counts.clear()

    def read(self, name: str, query: Callable[[], Value], codec: Codec = IDENTITY) -> Value:
        """Read an input from the cell, record its value if the value has changed, and return the value.

        Args:
            name: Name of the input.
            query: Function that reads the value from the cell.
            codec: Codec of the value.

        Raises:
            Exception: The cell raised an exception; the exception is recorded and raised again.
        """
        self._read_counts[name] += 1
        read_count = self._read_counts[name]
        try:
            value = query()
        except (Exception, Stopped) as error:
            self._emit(InputRead(name, read_count, str(error), type(error).__name__))
            raise
        encoded = codec.encode(value)
        if name not in self._last_values or encoded != self._last_values[name]:
            self._last_values[name] = encoded
            self._emit(InputRead(name, read_count, encoded))
        return value
