"""Shipped missions under random faults of objects, tool and detector: each run ends after few picks.

A run has random parts (heavy, slippery, unsealable) and a detector with random misses, wrong classes and
false detections; the ledger assumes high error rates, or believes the rates of the cell file.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from executive.cell.frame import Answer
from executive.errors import Fault
from executive.station.station import Station
from executive.testing.faults import after, during, make_detector_effect, tool_does_not_release
from executive.testing.faulty_cell import Effect, Occurrence, ScheduledFault
from executive.testing.run_mission import MissionResult, run_mission
from tests.benchmarks.report import Figures, run_command

ATTEMPTS = {
    "sort_overhead": 6, "sort_wrist": 6, "sort_stacked": 6, "weigh_and_sort": 6, "sort_with_second_chance": 4,
    "sort_fasteners": 6, "sort_by_priority": 6, "sort_and_verify": 6, "two_detectors": 6,
}  # fmt: skip
"""Missions, and the number of failed attempts after which each rejects an object."""
ASSUMED_RATES = {"miss_rate": 0.15, "confusion_rate": 0.05, "false_detections": 0.2, "jitter": 2.0}
"""Rates of the detector of a fake cell in every second run, as for a detector that was never measured."""
UNMEASURED_THRESHOLD = 0.49
"""Threshold without a measurement, so that every second run on a simulated cell assumes high rates."""
MAX_TOOL_DISTANCE = 0.03
"""Maximum horizontal distance between tool and object if the tool touches the object [m]."""
TIMEOUT = 900.0
"""Longest time of a run on its clock [s]."""


@dataclass
class Parts:
    """Random properties of the objects by their number, and the number of picks of each object.

    Attributes:
        heavy: Objects that fall as soon as they are lifted.
        slippery: Objects that fall during a transport with the probability 0.5.
        unsealable: Objects on which the tool never closes.
        rng: Random generator of the slips.
        pick_counts: Number of times that the tool closed on each object.
    """

    heavy: set[int]
    slippery: set[int]
    unsealable: set[int]
    rng: np.random.Generator
    pick_counts: Counter[int]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Parts:
        """Return random properties of up to 20 objects."""
        kinds = rng.choice(["", "", "heavy", "slippery", "unsealable"], 20)
        numbers = {kind: set(np.flatnonzero(kinds == kind)) for kind in ("heavy", "slippery", "unsealable")}
        return cls(**numbers, rng=rng, pick_counts=Counter())

    def close(self, proceed: Callable[[], None], occurrence: Occurrence) -> None:
        """Close the tool and count the pick, unless the touched object cannot be sealed."""
        tool = occurrence.context.station.unrecorded_cell.arm.tool_pose.position
        objects = occurrence.context.world.objects
        # The objects of a stack lie one above the other.
        distances = [math.dist(one.position, tool) for one in objects]
        number = int(np.argmin(distances)) if distances else -1
        if distances and math.dist(objects[number].position[:2], tool[:2]) <= MAX_TOOL_DISTANCE:
            self.pick_counts[number] += 1
            if number in self.unsealable:
                return
        proceed()

    def drop(self, occurrence: Occurrence) -> bool:
        """Drop a heavy object after the start of a motion, and a slippery one at a random moment."""
        context = occurrence.context
        if (held := context.world.held_object) is None or context.motion_progress < 0.05:
            return False
        number = next(index for index, one in enumerate(context.world.objects) if one.body == held.body)
        if number in self.heavy or (number in self.slippery and self.rng.random() < 0.01):
            context.world.release(held)
        return False


def make_errors(rng: np.random.Generator, labels: Sequence[str]) -> Callable[[Answer], Answer]:
    """Return a change of answers: misses, wrong classes and false detections with random rates."""
    miss_rate, confusion_rate, false_rate = rng.uniform(0, (0.3, 0.1, 0.2))

    def change(answer: Answer) -> Answer:
        found = [one for one in answer.confident if rng.random() >= miss_rate]
        labels_found = [
            str(rng.choice(labels)) if rng.random() < confusion_rate else one.label for one in found
        ]
        found = [replace(one, label=label) for one, label in zip(found, labels_found, strict=True)]
        if found and rng.random() < false_rate:
            left, top = rng.uniform((200, 110), (420, 330))
            found.append(replace(found[0], box=(left, top, left + 26.0, top + 26.0)))
        return replace(answer, confident=tuple(found))

    return change


def run_with_faults(seed: int, kind: str) -> tuple[str, int, MissionResult, Parts]:
    """Run the mission of a seed; return its name, its number of attempts, the result and the parts."""
    rng = np.random.default_rng([seed, 43])
    mission = list(ATTEMPTS)[seed % len(ATTEMPTS)]
    parts = Parts.draw(rng)
    labels = ("bolt", "nut", "washer") if "fasteners" in mission else ("cube", "sphere", "duck")
    stuck_releases = [
        number for number in range(1, 1000) if np.random.default_rng([seed, number]).random() < 0.05
    ]
    faults: list[ScheduledFault] = [
        after(0.0, Effect("part", parts.drop, {"close": parts.close})),
        after(0.0, make_detector_effect("detector_errs", make_errors(rng, labels))),
        during("*/Release", tool_does_not_release(), activations=stuck_releases),
    ]
    values: dict[str, Any] = {"cell.kind": kind}
    if seed % 2:
        detector = "fasteners" if "fasteners" in mission else "embedded"
        rates = ASSUMED_RATES if kind == "fake" else {"threshold": UNMEASURED_THRESHOLD}
        values |= {f"cell.detectors.{detector}.{key}": str(value) for key, value in rates.items()}
    result = run_mission(mission, Station, seed=seed, set=values, faults=faults, timeout=TIMEOUT)
    return mission, ATTEMPTS[mission], result, parts


def explain_problem(seed: int, kind: str) -> str:
    """Return what is wrong with the run of a seed, or ""."""
    try:
        mission, attempts, result, parts = run_with_faults(seed, kind)
    except Fault as error:
        return f"seed {seed}: {error}"
    problems = []
    if result.status == "FAULT":
        problems.append(f"{result.reason}: {result.message}")
    if parts.pick_counts and max(parts.pick_counts.values()) > attempts + 1:
        problems.append(f"{max(parts.pick_counts.values())} picks of an object")
    named = [row.item for row in result.ledger.list_items() if row.state in ("rejected", "lost")]
    if not result.agrees and (result.status == "SUCCESS" or not named):
        problems.append(f"{result.status}, items {dict(result.items)}, audit {result.audit}")
    return f"seed {seed}, {mission}: {'; '.join(problems)}" if problems else ""


def measure(runs: int = 500, seed: int = 0, kind: str = "fake") -> Figures:
    """Run shipped missions with random faults on a cell of `--kind` fake or sim."""
    seeds = range(seed, seed + runs)
    with ProcessPoolExecutor(2) as pool:
        problems = [text for text in pool.map(explain_problem, seeds, [kind] * runs) if text]
    return {"runs": runs, "without_problem": runs - len(problems), "problems": problems}


if __name__ == "__main__":
    run_command(measure)
