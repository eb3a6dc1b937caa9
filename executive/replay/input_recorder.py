"""Recorder of the inputs of a run: the answers of its cell.

Every answer that differs from the last answer to the same question becomes an event. A replay of these
answers repeats all decisions of the tree, its skills and the ledger, without the cell.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from executive.errors import Stopped
from executive.events import Emit, InputRead
from executive.replay.codec import PLAIN, Codec

Answer = TypeVar("Answer")


class InputRecorder:
    """Emits every new answer of a cell as an event; used by the tick thread only.

    Args:
        emit: Takes the events.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._reads: dict[str, int] = {}
        self._last: dict[str, object] = {}

    def begin_step(self) -> None:
        """Begin a control step: the count of reads starts again."""
        self._reads.clear()

    def read(self, name: str, ask: Callable[[], Answer], codec: Codec = PLAIN) -> Answer:
        """Return the cell's answer, and record it if it is new.

        Args:
            name: Name of the input; the same question has the same name.
            ask: Asks the cell.
            codec: Makes the answer plain.

        Raises:
            Exception: The cell raised it; it is recorded, too.
        """
        nth = self._reads[name] = self._reads.get(name, 0) + 1
        try:
            answer = ask()
        except (Exception, Stopped) as error:
            self._emit(InputRead(name, nth, str(error), type(error).__name__))
            raise
        value = codec.write(answer)
        if name not in self._last or value != self._last[name]:
            self._last[name] = value
            self._emit(InputRead(name, nth, value))
        return answer
