"""A frame on its way through a cascade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from executive.cell import Clock, Detector, Request
from executive.errors import Unavailable
from executive.messages import Answer, Frame
from executive.vision.detectors.cascade.breaker import Breaker
from executive.vision.detectors.requests import EARLY


@dataclass(eq=False)
class Member:
    """A detector that a cascade asks.

    Attributes:
        name: Its name in the cell file.
        breaker: Whether it is worth asking.
        complaint: Why it gave no answer the last time.
    """

    name: str
    detector: Detector
    breaker: Breaker
    complaint: str = ""

    def absence(self) -> str:
        """Return why it is not asked now."""
        return (
            f"not asked until {self.breaker.next_trial:.1f} s, for {self.breaker.failures} times in a row "
            f"it gave no answer ({self.complaint})"
        )


class CascadeRequest:
    """The question that goes from one member to the next; implements `executive.cell.Request`.

    It has no thread: every look at `ready` lets it go on as far as it can.

    Args:
        members: Whom to ask, in order.
        frame: What about.
        view: Which part of it.
        due: Time on the run's clock from which an answer is visible [s].
        clock: The run's clock.
    """

    def __init__(self, members: Sequence[Member], frame: Frame, view: str, due: float, clock: Clock) -> None:
        self._left = list(members)
        self._frame = frame
        self._view = view
        self._due = due
        self._clock = clock
        self._asked: tuple[Member, Request] | None = None
        self._complaints: list[str] = []
        self._answer: Answer | None = None
        self._go_on()

    @property
    def ready(self) -> bool:
        """True from the tick at which a member has answered, or none is left, and the time has come."""
        self._go_on()
        return self._asked is None and self._clock.now >= self._due - EARLY

    def result(self) -> Answer:
        """Return what the first member says that gives an answer, as its own.

        Raises:
            Unavailable: None gave one; the text says why, of each.
        """
        if not self.ready:
            raise RuntimeError("the cascade has no answer yet; wait until `ready` is true")
        if self._answer is None:
            raise Unavailable(f"no detector gave an answer. {'. '.join(self._complaints)}")
        return self._answer

    def hear(self) -> bool:
        """Hear whoever is asked, and ask nobody else; return whether there was something to hear.

        For a request that nobody waits for any more: its member's breaker learns from it all the same.
        """
        if self._asked is None:
            return False
        member, request = self._asked
        if not request.ready:
            return False
        self._asked = None
        try:
            self._answer = request.result()
            member.breaker.succeeded()
        except Unavailable as error:
            member.breaker.failed(self._clock.now)
            member.complaint = str(error)
            self._complaints.append(f"{member.name}: {error}")
        return True

    def _go_on(self) -> None:
        """Hear whoever is asked, and ask the next, until somebody has to be waited for or all is said."""
        while self._answer is None and (self._asked is not None or self._ask_next()):
            if not self.hear():
                return

    def _ask_next(self) -> bool:
        """Ask the next member that is worth it; return whether there is one."""
        while self._left:
            member = self._left.pop(0)
            if member.breaker.admits(self._clock.now):
                self._asked = member, member.detector.request(self._frame, self._view)
                return True
            self._complaints.append(f"{member.name}: {member.absence()}")
        return False
