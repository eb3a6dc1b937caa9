"""What the operator asked for in a run, as it can be asked for again."""

from __future__ import annotations

from executive.events import Event

QUIT = "quit"


class Requests:
    """Follows the `request` events of a run; an observer."""

    def __init__(self) -> None:
        self._words: list[str] = []

    def __call__(self, event: Event) -> None:
        """Note `event` if it is a request."""
        if event.kind == "request":
            self._words.append(event.data["wanted"] or QUIT)

    @property
    def words(self) -> list[str]:
        """What a list of requests must say for a run to be asked for the same.

        Whoever is asked after the end of the list wants nothing more: that does not have to be said, but in
        a list that would be empty without it.
        """
        words = list(self._words)
        while len(words) > 1 and words[-1] == QUIT:
            words.pop()
        return words
