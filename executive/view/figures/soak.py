"""What many runs in one process leave in it, and how that is told."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

WARM = 5
"""Runs after which everything has been loaded that a run loads."""
MOST_GROWTH = 20.0
"""Most that the memory may grow over all runs [MB]; a thousand simulated runs may add 0.02 MB each."""
MOST_OBJECTS = 2.0
"""Most objects that a run may leave behind, over the last three quarters of the runs; its sample is one."""


@dataclass(frozen=True)
class Sample:
    """What a process has after a run.

    Attributes:
        memory: Its resident memory [MB].
        threads: Its threads.
        handles: Its open file descriptors.
        objects: Objects that Python's collector follows.
    """

    memory: float
    threads: int
    handles: int
    objects: int


@dataclass(frozen=True)
class SoakFigures:
    """Many runs of a mission in one process.

    Attributes:
        mission: Its name.
        cell: Kind of its cell, and where the detections come from.
        seed: That of the first run; the others follow.
        samples: What the process had after each run.
        failed: Seed and verdict of every run that did not succeed, or whose books were wrong.
        wanted: How many runs were to be made.
    """

    mission: str
    cell: str
    seed: int
    samples: tuple[Sample, ...]
    failed: tuple[tuple[int, str], ...]
    wanted: int

    @property
    def complete(self) -> bool:
        """False where somebody ended the campaign before its last run."""
        return len(self.samples) == self.wanted

    @property
    def slope(self) -> float:
        """Memory that a run adds [MB]: least squares over the last three quarters of the runs."""
        return self._slope(lambda sample: sample.memory)

    @property
    def growth(self) -> float:
        """Median memory of the last quarter of the runs over that of the first [MB], once warm."""
        memory = [sample.memory for sample in self.samples[min(WARM, len(self.samples)) - 1 :]]
        quarter = max(1, len(memory) // 4)
        return statistics.median(memory[-quarter:]) - statistics.median(memory[:quarter])

    @property
    def left_behind(self) -> float:
        """Objects that a run leaves behind: least squares over the last three quarters of the runs."""
        return self._slope(lambda sample: sample.objects)

    @property
    def warm(self) -> Sample:
        """What the process had when everything was loaded; there must have been a run."""
        return self.samples[min(WARM, len(self.samples)) - 1]

    @property
    def problems(self) -> tuple[str, ...]:
        """What grew although it must not, in sentences."""
        return tuple(_problems(self))

    def _slope(self, of: Callable[[Sample], float]) -> float:
        values = [of(sample) for sample in self.samples[len(self.samples) // 4 :]]
        if len(values) < 2:
            return 0.0
        return statistics.linear_regression(range(len(values)), values).slope


def as_plain(figures: SoakFigures) -> dict[str, Any]:
    """Return the figures as plain values, memory in MB."""
    return {
        "mission": figures.mission,
        "cell": figures.cell,
        "seed": figures.seed,
        "runs": len(figures.samples),
        "wanted": figures.wanted,
        **(_grown(figures) if figures.samples else {}),
        "problems": list(figures.problems),
        "failed": [{"seed": seed, "verdict": verdict} for seed, verdict in figures.failed],
        "memory_mb": [sample.memory for sample in figures.samples],
    }


def soak_text(figures: SoakFigures) -> str:
    """Return the figures as lines of text, and a line for every problem and every run that failed."""
    return "\n".join(_lines(figures))


def _lines(figures: SoakFigures) -> Iterator[str]:
    runs = len(figures.samples)
    yield f"{figures.mission} ({figures.cell}): {runs} runs in one process, seeds from {figures.seed}"
    if not figures.complete:
        yield f"  ended by the user; {figures.wanted} runs were wanted"
    if not runs:
        return
    warm, last = figures.warm, figures.samples[-1]
    yield (
        f"  memory {last.memory:.1f} MB after {warm.memory:.1f} MB when warm; "
        f"{figures.slope:+.4f} MB a run ({MOST_GROWTH / runs:.3g} allowed), last quarter over first "
        f"{figures.growth:+.1f} MB ({MOST_GROWTH:g} allowed)"
    )
    yield (
        f"  threads {last.threads} after {warm.threads}, handles {last.handles} after {warm.handles}, "
        f"objects {last.objects} after {warm.objects}: {figures.left_behind:+.2f} a run "
        f"({MOST_OBJECTS:g} allowed)"
    )
    yield from (f"  {problem}" for problem in figures.problems)
    yield f"  runs that did not succeed: {len(figures.failed) or 'none'}"
    yield from (f"    seed {seed}: {verdict}" for seed, verdict in figures.failed)


def _problems(figures: SoakFigures) -> Iterator[str]:
    if not figures.samples:
        return
    runs, warm, last = len(figures.samples), figures.warm, figures.samples[-1]
    for what, value, most in (
        ("a run adds {:.4f} MB of memory", figures.slope, MOST_GROWTH / runs),
        ("the last quarter of the runs needs {:.1f} MB more than the first", figures.growth, MOST_GROWTH),
        ("a run leaves {:.1f} objects behind", figures.left_behind, MOST_OBJECTS),
    ):
        if value > most:
            yield f"{what.format(value)}; {most:.3g} is allowed"
    for what, now, then in (
        ("threads", last.threads, warm.threads),
        ("open files", last.handles, warm.handles),
    ):
        if now > then:
            yield f"{now} {what} after the last run, {then} after run {min(WARM, runs)}"


def _grown(figures: SoakFigures) -> dict[str, Any]:
    return {
        "slope_mb": round(figures.slope, 5),
        "growth_mb": round(figures.growth, 3),
        "objects_left_behind": round(figures.left_behind, 3),
        "warm": _plain(figures.warm),
        "last": _plain(figures.samples[-1]),
    }


def _plain(sample: Sample) -> dict[str, Any]:
    return {
        "memory_mb": sample.memory,
        "threads": sample.threads,
        "handles": sample.handles,
        "objects": sample.objects,
    }
