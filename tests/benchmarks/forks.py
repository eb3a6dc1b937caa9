"""Child processes that continue from the present state of this process and send back a result."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, NoReturn


class ForkRunner:
    """Continues this process in one child after the other and receives the result of each.

    A child has everything that its parent has, a simulated world included. Only the thread that forked
    continues in the child.

    Args:
        timeout: Time after which a child without a result is killed [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._pipe: Connection | None = None

    @property
    def is_child(self) -> bool:
        """True in a child."""
        return self._pipe is not None

    def fork_and_wait(self) -> tuple[Any, str] | None:
        """Return None in a new child; in the parent, wait and return the child's result and a problem or "".

        A child must call `send_and_exit` in any case, or it continues as if it were its parent.
        """
        reading, writing = Pipe(duplex=False)
        child = os.fork()
        if child == 0:
            self._pipe = writing
            return None
        writing.close()
        with reading:
            if not reading.poll(self._timeout):
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return None, f"the child sent nothing for {self._timeout:g} s and was killed"
            try:
                answer = reading.recv(), ""
                os.waitpid(child, 0)
                return answer
            except EOFError:
                code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
                return None, f"the child ended with exit code {code} and sent nothing"

    def send_and_exit(self, result: Any) -> NoReturn:
        """Send `result` to the parent and end this child at once, without any clean-up."""
        assert self._pipe is not None, "only a child can send a result"
        try:
            self._pipe.send(result)
            os._exit(0)
        finally:
            os._exit(1)

    def call(self, function: Callable[[], Any]) -> tuple[Any, str]:
        """Call `function` in a child; return its result, or None and the reason why there is none."""
        answer = self.fork_and_wait()
        if answer is not None:
            result, problem = answer
            return result or (None, problem)
        try:
            self.send_and_exit((function(), ""))
        except BaseException as error:
            self.send_and_exit((None, f"{type(error).__name__}: {error}"))
