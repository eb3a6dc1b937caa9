"""Replay of recorded inputs."""

from __future__ import annotations

from collections import deque
from typing import Any

from executive import errors
from executive.errors import Fault
from executive.events import InputRead
from executive.replay.codec import PLAIN, Codec
from executive.replay.input_log import InputLog


class Unrecorded(Fault):
    """The replayed run reads an input that the recorded run never read: there is no answer."""


class InputReplayer:
    """Answers questions with the recorded answers, in the same control steps.

    Args:
        log: The recorded inputs.

    Attributes:
        unanswered: Message of the first question without an answer, or "".
    """

    def __init__(self, log: InputLog) -> None:
        self._inputs = {name: deque(inputs) for name, inputs in log.inputs.items()}
        self._tick = 0
        self._reads: dict[str, int] = {}
        # A run that was killed before it recorded its clock is resumed, too: its clock showed the steps.
        self._last: dict[str, Any] = {"clock": 0.0}
        self.unanswered = ""

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`: the count of reads starts again."""
        self._tick = tick
        self._reads.clear()

    def read(self, name: str, codec: Codec = PLAIN) -> Any:
        """Return the recorded answer.

        Args:
            name: Name of the input.
            codec: Makes the answer from plain values.

        Raises:
            Unrecorded: The recorded run had never read this input before.
            Exception: The cell raised an exception; this one has the same name and text.
        """
        nth = self._reads[name] = self._reads.get(name, 0) + 1
        inputs = self._inputs.get(name, deque())
        while inputs and (inputs[0].tick, inputs[0].read.nth) <= (self._tick, nth):
            read = inputs.popleft().read
            if read.raised:
                raise _exception(read)
            self._last[name] = read.value
        if name not in self._last:
            message = f"the record holds no answer to what is asked here first: {name}"
            self.unanswered = self.unanswered or message
            raise Unrecorded(message)
        return codec.read(self._last[name])


def _exception(read: InputRead) -> BaseException:
    """Return an exception with the recorded name and text."""
    kind = getattr(errors, read.raised, None) or type(read.raised, (Exception,), {})
    error = kind(read.value)
    assert isinstance(error, BaseException)
    return error
