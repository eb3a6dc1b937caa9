"""How many plans of a run were made ahead, and what waiting for the others cost."""

from __future__ import annotations

from executive.events import Event


class PlanningTally:
    """Counts the plans of a run; an observer."""

    def __init__(self) -> None:
        self._motions = 0
        self._ahead = 0
        self._waited = 0.0

    def __call__(self, event: Event) -> None:
        """Count `event` if it is a plan."""
        if event.kind == "plan":
            self._motions += 1
            self._ahead += bool(event.data["ahead"])
            self._waited += float(event.data["waits"])

    def figures(self) -> dict[str, float]:
        """Return the number of plans asked for, of those made ahead, and the time waited for plans [s].

        A motion planned anew counts once more, and one for which no way was found counts, too.
        """
        return {"motions": self._motions, "ahead": self._ahead, "waited_s": round(self._waited, 4)}
