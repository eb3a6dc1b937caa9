"""What killing a mission at random moments and taking it up again has shown, and how it is told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Kill:
    """One run that was killed and taken up again.

    Attributes:
        number: Which one it was.
        seed: Of the run.
        after: When it was killed, after its beginning [s] by the wall clock.
        clock: How far it was, on its own clock [s].
        running: The skills that were under way.
        change: What happened to the world meanwhile, or "".
        status: How it ended.
        problems: What was not as it has to be, in sentences.
        run: Its directory.
    """

    number: int
    seed: int
    after: float
    clock: float
    running: tuple[str, ...] = ()
    change: str = ""
    status: str = ""
    problems: tuple[str, ...] = ()
    run: str = ""


@dataclass(frozen=True)
class KillFigures:
    """A mission killed many times.

    Attributes:
        mission: Its name.
        cell: Kind of its cell, and where the detections come from.
        wanted: How many kills were asked for.
        kills: What came of them.
        ended: Runs that had come to their end when they were to be killed; each was tried anew.
    """

    mission: str
    cell: str
    wanted: int
    kills: Sequence[Kill] = ()
    ended: int = 0

    @property
    def complete(self) -> bool:
        """False where somebody ended the campaign before its last kill."""
        return len(self.kills) == self.wanted

    @property
    def failed(self) -> Sequence[Kill]:
        """Those with something wrong about them."""
        return [kill for kill in self.kills if kill.problems]


def as_plain(figures: KillFigures) -> dict[str, Any]:
    """Return the figures as plain values."""
    return {
        "mission": figures.mission,
        "cell": figures.cell,
        "wanted": figures.wanted,
        "ended_before": figures.ended,
        "changed": sum(bool(kill.change) for kill in figures.kills),
        "failed": len(figures.failed),
        "kills": [asdict(kill) for kill in figures.kills],
    }


def kill_text(figures: KillFigures) -> str:
    """Return the figures as lines of text, and some for every kill with something wrong about it."""
    return "\n".join(_lines(figures))


def _lines(figures: KillFigures) -> Iterator[str]:
    kills = figures.kills
    changed = sum(bool(kill.change) for kill in kills)
    yield f"{figures.mission} ({figures.cell}): killed {len(kills)} times, the world changed in {changed}"
    if not figures.complete:
        yield f"  ended by the user; {figures.wanted} kills were to be tried"
    yield f"  under way: {_counted(skill for kill in kills for skill in kill.running or ('nothing',))}"
    yield f"  ended, taken up again: {_counted(kill.status for kill in kills)}"
    yield f"  not as it has to be: {len(figures.failed) or 'none'}"
    for kill in figures.failed:
        change = f"; {kill.change}" if kill.change else ""
        yield f"  kill {kill.number}, seed {kill.seed}, at {kill.clock:.2f} s{change}: {kill.run}"
        yield from (f"    {problem}" for problem in kill.problems)


def _counted(words: Iterator[str]) -> str:
    counts = Counter(words).most_common()
    return ", ".join(f"{word} {count}" for word, count in counts) or "nothing"
