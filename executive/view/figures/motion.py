"""The figures of the bench of motion, and how they are shown."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table


@dataclass(frozen=True)
class MethodFigures:
    """One way to move, over all pairs.

    Attributes:
        name: What it is called.
        time: Mean motion time of a pair, bin to object to bin, without dwells [s].
        peaks: Largest joint velocity, acceleration and jerk of any pair, each over its limit.
        planning: Median and 99th percentile of the time to plan one motion on the wall [ms], where measured.
        clearance: Least distance to anything that must not be touched [m], where measured.
    """

    name: str
    time: float
    peaks: tuple[float, float, float]
    planning: tuple[float, float] | None = None
    clearance: float | None = None


@dataclass(frozen=True)
class PlanningFigures:
    """How long the planner took on the wall for one motion, its checks included.

    Attributes:
        motions: How many were planned, those for which no way was found included.
        median, p99: [ms]
        within_50, within_150: Share of the motions planned within so many milliseconds.
        failures: Why a motion was not planned, one text each.
    """

    motions: int
    median: float
    p99: float
    within_50: float
    within_150: float
    failures: tuple[str, ...]


@dataclass(frozen=True)
class ExecutionFigures:
    """What was seen while pairs were executed in the live world.

    Attributes:
        pairs: How many.
        clearance: Least distance of arm, tool and load to anything that must not be touched [m], or None
            where nothing of it came near enough to be measured.
        nearest: What that was, and to what.
        contacts: What touched what although it must not, one text each.
        slip: How far an object moved in the tool's frame between the grasp and the drop, at most [m].
        missed: Grasps that did not hold.
        drops: Objects lost on the way.
        tracking: Largest difference between a joint and its command [rad].
        time: Mean motion time of a pair [s], or None where no object was brought.
        failures: Why a motion was not planned, one text each.
    """

    pairs: int
    clearance: float | None
    nearest: str
    contacts: tuple[str, ...]
    slip: float
    missed: int
    drops: int
    tracking: float
    time: float | None
    failures: tuple[str, ...]


@dataclass(frozen=True)
class MotionFigures:
    """All of the bench, of one run on one machine.

    Attributes:
        cell: Name of the cell.
        pairs: Random pairs that every method moved between.
        seed: What chance drew from.
        margin: Distance that the cell asks for [m].
        article: The fixed-step cycle; its time is that of its moves.
        article_cycle: Its time with its dwells [s].
        stopping: At rest at every corner.
        toppra: Through the same corners by TOPP-RA.
        floor: Through everything.
        free_floor: Time of the floor where the first posture is free too [s].
        ours: The planner's motions.
        nearest: What came nearest to what in them.
        planning: What planning them took.
        execution: What was seen in the live world, if pairs were executed.
    """

    cell: str
    pairs: int
    seed: int
    margin: float
    article: MethodFigures
    article_cycle: float
    stopping: MethodFigures
    toppra: MethodFigures
    floor: MethodFigures
    free_floor: float
    ours: MethodFigures
    nearest: str
    planning: PlanningFigures
    execution: ExecutionFigures | None = None

    @property
    def methods(self) -> tuple[MethodFigures, ...]:
        """All of them, slowest kind first."""
        return self.article, self.stopping, self.toppra, self.ours, self.floor

    def over(self, other: MethodFigures) -> float:
        """Return the planner's motion time over that of another method."""
        return self.ours.time / other.time


def as_plain(figures: MotionFigures) -> dict[str, Any]:
    """Return the figures as plain values: times in s, planning in ms, distances in mm, angles in degrees."""
    planning, execution = figures.planning, figures.execution
    return {
        "cell": figures.cell,
        "pairs": figures.pairs,
        "seed": figures.seed,
        "margin_mm": round(figures.margin * 1000, 3),
        "methods": [_method(figures, method) for method in figures.methods],
        "article_cycle_s": round(figures.article_cycle, 4),
        "free_floor_s": round(figures.free_floor, 4),
        "ours_over": {
            "article": round(figures.over(figures.article), 4),
            "article_cycle": round(figures.ours.time / figures.article_cycle, 4),
            "stops_at_vias": round(figures.over(figures.stopping), 4),
            "toppra": round(figures.over(figures.toppra), 4),
            "floor": round(figures.over(figures.floor), 4),
            "free_floor": round(figures.ours.time / figures.free_floor, 4),
        },
        "nearest": figures.nearest,
        "planning": {
            "motions": planning.motions,
            "median_ms": round(planning.median, 2),
            "p99_ms": round(planning.p99, 2),
            "within_50_ms": round(planning.within_50, 4),
            "within_150_ms": round(planning.within_150, 4),
            "failures": list(planning.failures),
        },
        "execution": None if execution is None else _execution(execution),
    }


def print_figures(figures: MotionFigures) -> None:
    """Print the figures on standard output as tables and sentences."""
    console = Console(highlight=False, markup=False)
    for part in _parts(figures):
        console.print(part, soft_wrap=isinstance(part, str))


def _parts(figures: MotionFigures) -> Iterator[RenderableType]:
    yield (
        f"{figures.cell}: {figures.pairs} random pairs, seed {figures.seed}; "
        "motion from bin to object to bin, without dwells"
    )
    yield _table(figures)
    yield (
        "  s: mean; v, a, j: largest joint velocity, acceleration, jerk over the limit;\n"
        "  p50, p99: planning one motion, on the wall; mm: least distance to what must not be touched\n"
        f"  ours: {figures.over(figures.toppra):.2f} of TOPP-RA's time, "
        f"{figures.ours.time / figures.free_floor:.2f} of the floor's with the first posture free "
        f"({figures.free_floor:.2f} s)\n"
        f"  the article's cycle takes {figures.article_cycle:.2f} s with its dwells; "
        f"ours comes nearest with {figures.nearest}, margin {figures.margin * 1000:g} mm"
    )
    planning = figures.planning
    yield (
        f"\nplanning {planning.motions} motions: {planning.within_50:.1%} within 50 ms, "
        f"{planning.within_150:.1%} within 150 ms, median {planning.median:.0f} ms, p99 {planning.p99:.0f} ms"
    )
    yield from _counted("not planned", planning.failures)
    if figures.execution is not None:
        yield from _executed(figures.execution, figures.margin)


def _executed(one: ExecutionFigures, margin: float) -> Iterator[str]:
    time = "-" if one.time is None else f"{one.time:.3f}"
    yield (
        f"\nexecuted {one.pairs} pairs in the live world: {time} s of motion each\n"
        f"  least clearance {_mm(one.clearance) or '-'} mm ({one.nearest}), margin {margin * 1000:g} mm\n"
        f"  worst slip in the hand {one.slip * 1000:.2f} mm; {one.missed} grasps missed, {one.drops} objects "
        f"dropped\n"
        f"  worst tracking error {math.degrees(one.tracking):.5f}°; contacts that are not allowed: "
        f"{len(one.contacts)}"
    )
    yield from _counted("contact", one.contacts)
    yield from _counted("failed", one.failures)


def _counted(what: str, texts: tuple[str, ...]) -> Iterator[str]:
    for text, count in Counter(texts).most_common():
        yield f"  {what}, {count} times: {text}"


def _table(figures: MotionFigures) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False)
    table.add_column("")
    for heading in ("s", "/article", "/floor", "v", "a", "j", "p50 ms", "p99 ms", "mm"):
        table.add_column(heading, justify="right")
    for method in figures.methods:
        median, p99 = method.planning or (None, None)
        table.add_row(
            method.name,
            f"{method.time:.3f}",
            f"{method.time / figures.article.time:.2f}",
            f"{method.time / figures.floor.time:.2f}",
            *(f"{peak:.2f}" if peak < 10 else f"{peak:.0f}" for peak in method.peaks),
            *("" if value is None else f"{value:.1f}" for value in (median, p99)),
            _mm(method.clearance),
        )
    return table


def _method(figures: MotionFigures, method: MethodFigures) -> dict[str, Any]:
    median, p99 = method.planning or (None, None)
    return {
        "name": method.name,
        "time_s": round(method.time, 4),
        "over_article": round(method.time / figures.article.time, 4),
        "over_floor": round(method.time / figures.floor.time, 4),
        "peak_velocity": round(method.peaks[0], 4),
        "peak_acceleration": round(method.peaks[1], 4),
        "peak_jerk": round(method.peaks[2], 4),
        "planning_median_ms": None if median is None else round(median, 2),
        "planning_p99_ms": None if p99 is None else round(p99, 2),
        "clearance_mm": None if method.clearance is None else round(method.clearance * 1000, 3),
    }


def _execution(one: ExecutionFigures) -> dict[str, Any]:
    return {
        "pairs": one.pairs,
        "time_s": None if one.time is None else round(one.time, 4),
        "clearance_mm": None if one.clearance is None else round(one.clearance * 1000, 3),
        "nearest": one.nearest,
        "contacts": list(one.contacts),
        "slip_mm": round(one.slip * 1000, 3),
        "missed": one.missed,
        "drops": one.drops,
        "tracking_deg": round(math.degrees(one.tracking), 6),
        "failures": list(one.failures),
    }


def _mm(distance: float | None) -> str:
    return "" if distance is None else f"{distance * 1000:.1f}"
