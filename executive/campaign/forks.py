"""Children of this process that go on from where it stands, to try what it could not go on after."""

from __future__ import annotations

import os
import pickle
import select
import signal
import time
from typing import Any, NoReturn


class Forks:
    """Lets this process go on in a child, one after the other, and hears what each of them found.

    A child has everything that its parent had, a simulated world included, which goes on bit by bit as it
    would have gone on there. Of the threads only the one that forked goes on in it.

    Args:
        patience: Time after which a child that has told nothing is ended [s].
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._told: int | None = None

    @property
    def in_child(self) -> bool:
        """True in a child."""
        return self._told is not None

    def fork(self) -> tuple[Any, str] | None:
        """Return None in a new child; here, once it has ended, what it told and why it told nothing, or "".

        Whoever gets None must come to `tell` whatever happens, or the child goes on as if it were its parent.
        """
        heard, told = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(heard)
            self._told = told
            return None
        os.close(told)
        try:
            return self._hear(child, heard)
        finally:
            os.close(heard)

    def tell(self, found: Any) -> NoReturn:
        """Hand `found` to the parent and end this child at once: nothing of its parent's is cleaned up."""
        assert self._told is not None, "only a child has somebody to tell"
        code = 1
        try:
            with os.fdopen(self._told, "wb") as pipe:
                pipe.write(pickle.dumps(found))
            code = 0
        finally:
            os._exit(code)

    def _hear(self, child: int, pipe: int) -> tuple[Any, str]:
        text, deadline = b"", time.monotonic() + self._patience
        while select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))[0]:
            part = os.read(pipe, 1 << 16)
            if not part:
                break
            text += part
        else:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None, f"it told nothing for {self._patience:g} s and was ended"
        _, status = os.waitpid(child, 0)
        code = os.waitstatus_to_exitcode(status)
        if code or not text:
            return None, f"its process ended with {_named(code)} and told nothing"
        return pickle.loads(text), ""


def _named(code: int) -> str:
    """Return an exit code in words."""
    return f"exit code {code}" if code >= 0 else f"the signal {signal.Signals(-code).name}"
