"""The tape: what a cell was asked and what it answered.

While it records, every answer that is unlike the one before to the same question becomes a `sense` event.
While it plays, questions are answered from such events, and commands go nowhere: whatever is decided by a
tree, its skills and the ledger is then decided once more, from the same answers, without the cell.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from executive import errors
from executive.errors import Fault, Stopped
from executive.events import Emit, Exact
from executive.replay.codec import NOTHING, PLAIN, Codec
from executive.replay.input_log import Past, Sense


class Unrecorded(Fault):
    """Something was asked that the recorded run never asked: there is no answer to play."""


class Tape:
    """Records a cell's answers, or plays those of a `Past` and then goes on to record.

    Only the tick thread asks it.

    Args:
        emit: Takes its `sense` events.
        step: Length of a control step [s].
        now: The time on the cell's own clock [s].
        past: What to play; None: record from the beginning.
    """

    def __init__(self, emit: Emit, step: float, now: Callable[[], float], past: Past | None = None) -> None:
        self.playing = past is not None
        self.step = step
        self._emit = emit
        self._now = now
        self._tick = 0
        self._asked: dict[str, int] = {}
        self._last: dict[str, Any] = {}
        self._to_come = {name: deque(senses) for name, senses in past.senses.items()} if past else {}

    def begin_tick(self, tick: int) -> None:
        """Note that a control step begins."""
        self._tick = tick
        self._asked.clear()

    def go_live(self) -> None:
        """Play no more: from now on the cell itself is asked, and what it answers is recorded."""
        self.playing = False
        self._to_come = {}

    @property
    def now(self) -> float:
        """Time on the run's clock [s]: that of all control steps, and what a cell's own clock is ahead."""
        ahead = self._last.get("clock", 0.0) if self.playing else self._ahead()
        return self._tick * self.step + ahead

    def clock(self) -> float:
        """Return the time on the run's clock [s], as an answer of the cell."""
        ahead: float = self.sense("clock", self._ahead)
        return self._tick * self.step + ahead

    def command(self, do: Callable[[], Any]) -> Any:
        """Let the cell do something and return its answer; nothing is done while playing, and None returned.

        Raises:
            Exception: The exception that the cell raised, played as it was.
        """
        return self.sense("command", do, NOTHING)

    def sense(self, name: str, ask: Callable[[], Any], codec: Codec = PLAIN) -> Any:
        """Return the cell's answer to a question.

        Args:
            name: Name of the question; the same question has the same name.
            ask: Asks the cell.
            codec: Makes answers plain and reads them.

        Raises:
            Unrecorded: The tape plays, and this was never asked before.
            Exception: The exception that the cell raised; while playing, one of the same name and text.
        """
        nth = self._asked[name] = self._asked.get(name, 0) + 1
        if self.playing:
            return self._play(name, nth, codec)
        try:
            answer = ask()
        except (Exception, Stopped) as error:
            self._emit("sense", name=name, nth=nth, value=str(error), raised=type(error).__name__)
            raise
        value = codec.write(answer)
        if name not in self._last or value != self._last[name]:
            self._last[name] = value
            self._emit("sense", name=name, nth=nth, value=Exact(value))
        return answer

    def _play(self, name: str, nth: int, codec: Codec) -> Any:
        to_come = self._to_come.get(name, deque())
        while to_come and (to_come[0].tick, to_come[0].nth) <= (self._tick, nth):
            sense = to_come.popleft()
            if sense.raised:
                raise _error(sense)
            self._last[name] = sense.value
        if name not in self._last:
            raise Unrecorded(f"the record holds no answer to what is asked here first: {name}")
        return codec.read(self._last[name])

    def _ahead(self) -> float:
        return self._now() - self._tick * self.step


def _error(sense: Sense) -> BaseException:
    """Return an exception like the one recorded."""
    kind = getattr(errors, sense.raised, None) or type(sense.raised, (Exception,), {})
    return kind(sense.value)
