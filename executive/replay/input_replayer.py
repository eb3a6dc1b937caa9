"""Replay of recorded inputs."""

from __future__ import annotations

from collections import Counter, deque
from typing import Any

from executive import errors
from executive.errors import Fault
from executive.events import InputRead
from executive.replay.codecs import IDENTITY, Codec
from executive.replay.input_log import InputLog


class InputNotRecorded(Fault):
    """The replayed run reads an input that the recorded run had not read up to this control step."""


class InputReplayer:
    """Source of recorded values, which returns each value in the control step in which it was recorded.

    Args:
        log: The recorded inputs.

    Attributes:
        missing_input_message: Message about the first input without a recorded value, or "".
    """

    def __init__(self, log: InputLog) -> None:
        self._inputs = {name: deque(inputs) for name, inputs in log.inputs.items()}
        self._tick = 0
        self._read_counts: Counter[str] = Counter()
        # The journal of a killed run may contain no value of the clock; every clock starts at 0.
        self._last_values: dict[str, Any] = {"clock": 0.0}
        self.missing_input_message = ""

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`: set the number of reads of each input to 0."""
        self._tick = tick
        self._read_counts.clear()

    def read(self, name: str, codec: Codec = IDENTITY) -> Any:
        """Return the recorded value of an input.

        Args:
            name: Name of the input.
            codec: Codec of the value.

        Raises:
            InputNotRecorded: The recorded run had not read this input up to this control step.
            Exception: The recorded cell raised an exception with this class name and message.
        """
        self._read_counts[name] += 1
        inputs = self._inputs.get(name, deque())
        # Process all recorded values up to and including this read, in the order of their reads.
        this_read = (self._tick, self._read_counts[name])
        while inputs and (inputs[0].tick, inputs[0].reading.read_number) <= this_read:
            reading = inputs.popleft().reading
            if reading.exception:
                raise _make_exception(reading)
            self._last_values[name] = reading.value
        if name not in self._last_values:
            message = f"the journal contains no earlier value of the input {name}, which is read here"
            self.missing_input_message = self.missing_input_message or message
            raise InputNotRecorded(message)
        return codec.decode(self._last_values[name])


def _make_exception(reading: InputRead) -> BaseException:
    """Return an exception with the recorded class name and message; an unknown class is created."""
    exception_class = getattr(errors, reading.exception, None) or type(reading.exception, (Exception,), {})
    error = exception_class(reading.value)
    assert isinstance(error, BaseException)
    return error
