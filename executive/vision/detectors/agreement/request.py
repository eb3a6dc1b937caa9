"""A frame that several detectors search at the same time."""

from __future__ import annotations

from collections.abc import Mapping

from executive.cell import Clock, Request
from executive.errors import Unavailable
from executive.messages import Answer
from executive.vision.detectors.agreement.union import unite
from executive.vision.detectors.requests import EARLY


class AgreementRequest:
    """The question to every member of an agreement; implements `executive.cell.Request`.

    Args:
        name: Name of the agreement.
        requests: What its members work on, by their names.
        due: Time on the run's clock from which an answer is visible [s].
        clock: The run's clock.
    """

    def __init__(self, name: str, requests: Mapping[str, Request], due: float, clock: Clock) -> None:
        self._name = name
        self._requests = requests
        self._due = due
        self._clock = clock

    @property
    def ready(self) -> bool:
        """True from the tick at which every member has answered or failed, and the time has come.

        Every member is looked at in every tick, for some go on only then.
        """
        waited_for = [request for request in self._requests.values() if not request.ready]
        return not waited_for and self._clock.now >= self._due - EARLY

    def result(self) -> Answer:
        """Return what the members say together.

        Raises:
            Unavailable: One of them gave no answer, or they disagree about an object; the text says which.
        """
        if not self.ready:
            raise RuntimeError("the agreement has no answer yet; wait until `ready` is true")
        answers: dict[str, Answer] = {}
        complaints: list[str] = []
        for name, request in self._requests.items():
            try:
                answers[name] = request.result()
            except Unavailable as error:
                complaints.append(f"{name}: {error}")
        if complaints:
            raise Unavailable(f"not every detector gave an answer. {'. '.join(complaints)}")
        return unite(self._name, answers)
