"""Recorder of the inputs of a run: the answers of its cell.

Each answer that differs from the last answer to the same query becomes an event. A replay of these answers
repeats all decisions of the tree, its skills and the ledger, without the cell.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TypeVar

from executive.errors import Stopped
from executive.events import Emit, InputRead
from executive.replay.codec import PLAIN, Codec

Answer = TypeVar("Answer")


class InputRecorder:
    """Emits each new answer of a cell as an event; used in the thread of the control loop only.

    Args:
        emit: Emits an event.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._read_counts: Counter[str] = Counter()
        self._last_values: dict[str, object] = {}

    def begin_step(self) -> None:
        """Begin a control step, in which the counts of reads start from 0."""
        self._read_counts.clear()

    def read(self, name: str, query: Callable[[], Answer], codec: Codec = PLAIN) -> Answer:
        """Return the answer of the cell, and record a new answer.

        Args:
            name: Name of the input; equal queries have the same name.
            query: Queries the cell.
            codec: Converts the answer to plain values.

        Raises:
            Exception: The cell raised an exception, which is also recorded.
        """
        self._read_counts[name] += 1
        read_number = self._read_counts[name]
        try:
            answer = query()
        except (Exception, Stopped) as error:
            self._emit(InputRead(name, read_number, str(error), type(error).__name__))
            raise
        value = codec.write(answer)
        if name not in self._last_values or value != self._last_values[name]:
            self._last_values[name] = value
            self._emit(InputRead(name, read_number, value))
        return answer
