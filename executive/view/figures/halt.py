"""What halting a mission at many moments has shown, and how it is told."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

LONGEST_REST = 0.5
"""Time in which an arm must come to rest [s]."""
FARTHEST = 1e-6
"""Distance that a joint's command may have from the path it was on [rad]."""
MOST_ACCELERATION, MOST_JERK = 1.0, 1.02
"""Shares of the stop limits; differences over steps see a little more than the profile's constant jerk."""


@dataclass(frozen=True)
class Halt:
    """One moment at which the mission was halted.

    Attributes:
        tick: Control step during which it was wished for.
        clock: Its time on the run's clock [s].
        moving: Whether the arm was on the move.
        rest: Time until it was at rest [s].
        deviation: Farthest that a joint's command was from the path it was on [rad]; None: not simulated.
        acceleration: Largest acceleration of a joint over its stop limit, or None.
        jerk: Largest jerk of a joint over its stop limit, or None.
        holds: What the tool holds, as the run tells it.
        followed: Whether the mission was run once more in the same process.
        problems: What was not as it has to be, in sentences.
    """

    tick: int
    clock: float
    moving: bool = False
    rest: float = 0.0
    deviation: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    holds: str = ""
    followed: bool = False
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class HaltFigures:
    """A mission halted at many moments of one run.

    Attributes:
        mission: Its name.
        cell: Kind of its cell, and where the detections come from.
        seed: What chance drew from.
        ticks: Control steps of the run that nobody halted.
        halts: Every moment tried, in order.
        wanted: How many were to be tried.
    """

    mission: str
    cell: str
    seed: int
    ticks: int
    halts: tuple[Halt, ...]
    wanted: int

    @property
    def failed(self) -> tuple[Halt, ...]:
        """The halts that were not as they have to be."""
        return tuple(halt for halt in self.halts if halt.problems)

    @property
    def complete(self) -> bool:
        """False where somebody ended the campaign before its last halt."""
        return len(self.halts) == self.wanted

    def worst(self, of: Callable[[Halt], float | None]) -> tuple[float, int] | None:
        """Return the largest value of a figure and its tick, or None where it was not measured."""
        return max(
            ((value, halt.tick) for halt in self.halts if (value := of(halt)) is not None), default=None
        )


_WORST: dict[str, Callable[[Halt], float | None]] = {
    "rest_s": lambda halt: halt.rest,
    "deviation_rad": lambda halt: halt.deviation,
    "acceleration_share": lambda halt: halt.acceleration,
    "jerk_share": lambda halt: halt.jerk,
}


def as_plain(figures: HaltFigures) -> dict[str, Any]:
    """Return the figures as plain values: times in s, angles in rad, shares of the stop limits."""
    return {
        "mission": figures.mission,
        "cell": figures.cell,
        "seed": figures.seed,
        "ticks": figures.ticks,
        "points": len(figures.halts),
        "wanted": figures.wanted,
        "moving": sum(halt.moving for halt in figures.halts),
        "holding": sum(bool(halt.holds) for halt in figures.halts),
        "followed": sum(halt.followed for halt in figures.halts),
        "worst": {name: _plain_worst(figures.worst(of)) for name, of in _WORST.items()},
        "failed": [
            {"tick": halt.tick, "clock_s": halt.clock, "problems": list(halt.problems)}
            for halt in figures.failed
        ],
    }


def halt_text(figures: HaltFigures) -> str:
    """Return the figures as lines of text, and a line for every failure."""
    return "\n".join(_lines(figures))


def _lines(figures: HaltFigures) -> Iterator[str]:
    halts = figures.halts
    yield (
        f"{figures.mission} ({figures.cell}), seed {figures.seed}: halted at {len(halts)} moments "
        f"of a run of {figures.ticks} ticks"
    )
    if not figures.complete:
        yield f"  ended by the user; {figures.wanted} moments were to be tried"
    yield (
        f"  the arm was on the move at {sum(halt.moving for halt in halts)} of them, "
        f"something was in the tool at {sum(bool(halt.holds) for halt in halts)}; "
        f"the mission was run again after {sum(halt.followed for halt in halts)}"
    )
    yield from _worst(figures)
    yield f"  not as it has to be: {len(figures.failed) or 'none'}"
    yield from _problems(figures)


def _problems(figures: HaltFigures) -> Iterator[str]:
    """Yield a line per problem, with all ticks at which it was met."""
    met: dict[str, list[Halt]] = defaultdict(list)
    for halt in figures.failed:
        for problem in halt.problems:
            met[problem].append(halt)
    for problem, halts in met.items():
        first, last = halts[0], halts[-1]
        yield f"    tick {first.tick} ({first.clock:.2f} s): {problem}"
        if len(halts) > 1:
            yield f"      and at {len(halts) - 1} more, up to tick {last.tick}"


def _worst(figures: HaltFigures) -> Iterator[str]:
    texts = {
        "rest_s": f"longest time to rest {{:.3f}} s ({LONGEST_REST:g})",
        "deviation_rad": f"farthest from the path {{:.1e}} rad ({FARTHEST:g})",
        "acceleration_share": f"largest acceleration {{:.3f}} of its stop limit ({MOST_ACCELERATION:g})",
        "jerk_share": f"largest jerk {{:.3f}} of its stop limit ({MOST_JERK:g})",
    }
    for name, text in texts.items():
        found = figures.worst(_WORST[name])
        if found is not None:
            value, tick = found
            yield f"  {text.format(value)}, at tick {tick}"


def _plain_worst(found: tuple[float, int] | None) -> dict[str, Any] | None:
    return None if found is None else {"value": float(f"{found[0]:.6g}"), "tick": found[1]}
