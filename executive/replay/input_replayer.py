"""Replay of recorded inputs."""

from __future__ import annotations

from collections import Counter, deque
from typing import Any

from executive import errors
from executive.errors import Fault
from executive.events import InputRead
from executive.replay.codec import PLAIN, Codec
from executive.replay.input_log import InputLog


class Unrecorded(Fault):
    """The replayed run reads an input that the recorded run never read before."""


class InputReplayer:
    """Answers queries with the recorded answers, in the same control steps.

    Args:
        log: The recorded inputs.

    Attributes:
        unanswered: Message of the first query without a recorded answer, or "".
    """

    def __init__(self, log: InputLog) -> None:
        self._inputs = {name: deque(inputs) for name, inputs in log.inputs.items()}
        self._tick = 0
        self._read_counts: Counter[str] = Counter()
        # A run can be resumed even if it was killed before its first record of the clock, which is then 0.
        self._last_values: dict[str, Any] = {"clock": 0.0}
        self.unanswered = ""

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`, in which the counts of reads start from 0."""
        self._tick = tick
        self._read_counts.clear()

    def read(self, name: str, codec: Codec = PLAIN) -> Any:
        """Return the recorded answer.

        Args:
            name: Name of the input.
            codec: Converts plain values to the answer.

        Raises:
            Unrecorded: The recorded run had never read this input before.
            Exception: The cell raised an exception with the same name and text.
        """
        self._read_counts[name] += 1
        inputs, now = self._inputs.get(name, deque()), (self._tick, self._read_counts[name])
        while inputs and (inputs[0].tick, inputs[0].answer.nth) <= now:
            answer = inputs.popleft().answer
            if answer.raised:
                raise _build_exception(answer)
            self._last_values[name] = answer.value
        if name not in self._last_values:
            message = f"the record holds no answer to what is asked here first: {name}"
            self.unanswered = self.unanswered or message
            raise Unrecorded(message)
        return codec.read(self._last_values[name])


def _build_exception(answer: InputRead) -> BaseException:
    """Return an exception with the recorded name and text."""
    kind = getattr(errors, answer.raised, None) or type(answer.raised, (Exception,), {})
    error = kind(answer.value)
    assert isinstance(error, BaseException)
    return error
