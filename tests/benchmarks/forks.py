"""Child processes that continue from the present state of this process and send back a result."""

from __future__ import annotations

import os
import pickle
import select
import signal
import time
from collections.abc import Callable
from typing import Any, NoReturn


class Forks:
    """Continues this process in one child after the other and receives the result of each.

    A child has everything that its parent has, a simulated world included. Only the thread that forked
    continues in the child.

    Args:
        timeout: Time after which a child without a result is killed [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._pipe: int | None = None

    @property
    def is_child(self) -> bool:
        """True in a child."""
        return self._pipe is not None

    def fork(self) -> tuple[Any, str] | None:
        """Return None in a new child; in the parent the child's result and, if there is none, the reason.

        A child must call `send` in any case, or it continues as if it were its parent.
        """
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            self._pipe = writing
            return None
        os.close(writing)
        try:
            return self._receive(child, reading)
        finally:
            os.close(reading)

    def send(self, result: Any) -> NoReturn:
        """Send `result` to the parent and end this child at once, without any clean-up."""
        assert self._pipe is not None, "only a child can send a result"
        code = 1
        try:
            with os.fdopen(self._pipe, "wb") as pipe:
                pipe.write(pickle.dumps(result))
            code = 0
        finally:
            os._exit(code)

    def call(self, function: Callable[[], Any]) -> tuple[Any, str]:
        """Return what `function` returns in a child and, if it returns nothing, the reason."""
        answer = self.fork()
        if answer is None:
            try:
                result = function(), ""
            except BaseException as error:
                result = None, f"{type(error).__name__}: {error}"
            self.send(result)
        sent, problem = answer
        return sent or (None, problem)

    def _receive(self, child: int, pipe: int) -> tuple[Any, str]:
        data, deadline = b"", time.monotonic() + self._timeout
        while select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))[0]:
            part = os.read(pipe, 1 << 16)
            if not part:
                break
            data += part
        else:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None, f"the child sent nothing for {self._timeout:g} s and was killed"
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code or not data:
            return None, f"the child ended with exit code {code} and sent nothing"
        return pickle.loads(data), ""
