"""A mission killed at random moments and taken up again, the world changed meanwhile or not.

Each run goes on in a forked child that is killed as `kill -9` does, at a moment of the wall clock that
chance draws: in the middle of a control step, of a line of the journal, of a picture. Another child takes
the run up again from what is on the disk.
"""

from __future__ import annotations

import math
import os
import shutil
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.campaign.forks import Forks
from executive.campaign.subject import Subject
from executive.errors import ExecutiveError
from executive.geometry import Array
from executive.record.find_run import LATEST, find_run
from executive.record.journal import ending_of, read_journal
from executive.record.recorded_mission import recorded_mission
from executive.record.recorded_run import recorded_run
from executive.record.replay import compare
from executive.record.result import ledger_agrees
from executive.record.resumed_run import resumed_run
from executive.runtime.cells import cell_kind
from executive.tape.past import Past
from executive.testing.disturbances.hand import Hand, Thing
from executive.testing.meanwhile import meanwhile
from executive.view.figures.kill import Kill, KillFigures

PATIENCE = 300.0
"""Time that a child may take to take a run up again [s]."""
ASIDE = 0.06
"""How far an object is moved meanwhile [m]."""
CHANGES = ("moved", "removed", "dropped")
"""What happens to the world meanwhile: an object on the table is moved or taken away, or the tool lets go."""


def kill_often(
    subject: Subject,
    *,
    kills: int,
    changed: int,
    runs: Path,
    progress: Callable[[int, int], None] | None = None,
) -> KillFigures:
    """Kill a mission at random moments, take it up again each time, and look at what came of it.

    Args:
        subject: The mission and its cell; run number n has the n-th seed after its own.
        kills: How often.
        changed: In how many of them, evenly spread, the world is changed before the run is taken up.
        runs: Folder for the run directories; that of a run with nothing wrong about it is deleted.
        progress: Told how many of how many are done.
    """
    random = np.random.default_rng(subject.seed)
    began = time.monotonic()
    # In a child, too: this process never loads a model, whose threads a fork would leave behind locked.
    os.waitpid(_Trial(subject, 0, subject.seed, runs / "whole", random).begun(), 0)
    whole = time.monotonic() - began
    done: list[Kill] = []
    ended = 0
    while len(done) < kills:
        number = len(done)
        change = (
            str(random.choice(CHANGES)) if number * changed // kills < (number + 1) * changed // kills else ""
        )
        own = np.random.default_rng([subject.seed, number])
        trial = _Trial(subject, number, subject.seed + number, runs / str(number), own)
        after = float(random.uniform(0.0, whole))
        if not trial.killed(after):
            ended += 1
            continue
        done.append(trial.taken_up(after, change))
        if not done[-1].problems:
            shutil.rmtree(trial.runs)
        if progress is not None:
            progress(len(done), kills)
    return KillFigures(subject.name, subject.cell, kills, done, ended)


@dataclass(frozen=True)
class _Trial:
    """One run, killed and taken up again."""

    subject: Subject
    number: int
    seed: int
    runs: Path
    random: np.random.Generator

    def begun(self) -> int:
        """Begin the run in a child and return its process."""
        child = os.fork()
        if child == 0:
            try:
                recorded_run(
                    self.subject.loaded, self.subject.skills, seed=self.seed, runs=self.runs,
                    requests=self.subject.requests, kind=self.subject.kind, frames=False,
                )  # fmt: skip
            finally:
                os._exit(0)
        return child

    def killed(self, after: float) -> bool:
        """Begin the run and kill it; tell whether it had begun and not come to its end."""
        child = self.begun()
        time.sleep(after)
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if not os.WIFSIGNALED(status):
            return False
        try:
            entries = read_journal(self._path / "journal.jsonl")
        except ExecutiveError:
            return False
        return Past.of(entries).start is not None and ending_of(entries) is None

    def taken_up(self, after: float, change: str) -> Kill:
        """Change the world if wanted, take the run up again, and look at what came of it."""
        past = Past.of(read_journal(self._path / "journal.jsonl"))
        clock = max(entry["clock"] for entry in past.entries)
        kill = Kill(self.number, self.seed, round(after, 3), clock, _running(past), run=str(self._path))
        forks = Forks(PATIENCE)
        heard = forks.fork()
        if heard is None:
            try:
                # The change, too: whoever builds the cell may load a model (see `kill_often`).
                found = self._resumed(replace(kill, change=self._changed(past, change) if change else ""))
            except BaseException as error:
                found = _with(kill, "", [f"{type(error).__name__}: {error}"])
            forks.tell(found)
        told, why = heard
        return told if told is not None else _with(kill, "", [why])

    def _resumed(self, kill: Kill) -> Kill:
        result = resumed_run(self._path, self.subject.skills, frames=False, kind=self.subject.kind)
        entries = read_journal(self._path / "journal.jsonl")
        past = Past.of(entries)
        problems = [*_wrong(result, kill), *_twice(past)]
        difference = compare(self.subject.loaded, self.subject.skills, past, self.seed).difference
        if difference:
            problems.append(f"replayed, {difference}")
        return _with(kill, f"{result['status']} {result['reason']}".strip(), problems)

    def _changed(self, past: Past, change: str) -> str:
        """Change the world; return what happened, in words, or "" if there was nothing to change."""
        happened: list[str] = []

        def act(hand: Hand) -> None:
            held = hand.held
            standing = [thing for thing in hand.things if held is None or thing.body != held.body]
            on_table = [thing for thing in standing if self._on_table(thing)]
            if change == "dropped" and held is not None:
                hand.part()
                happened.append(f"the {held.label} fell from the tool")
            elif on_table:
                thing = on_table[int(self.random.integers(len(on_table)))]
                x, y, _ = thing.position
                free = [by for by in self._ways() if self._is_free(thing, by, standing)]
                if change == "removed" or not free:
                    hand.remove(thing)
                    happened.append(f"the {thing.label} at ({x:.3f}, {y:.3f}) was removed")
                else:
                    hand.move(thing, free[0])
                    happened.append(f"the {thing.label} at ({x:.3f}, {y:.3f}) was moved by {free[0]} m")

        assert past.start is not None
        loaded = recorded_mission(self._path, past.start, self.subject.skills)
        kind = self.subject.kind or cell_kind(loaded.cell_config.kind)
        meanwhile(self._path / "world.log", loaded, self.seed, act, kind)
        return "".join(happened)

    def _ways(self) -> Iterator[tuple[float, float]]:
        """Yield ways `(x, y)` [m] to move an object, in an order that chance draws."""
        turn = float(self.random.uniform(0, math.tau))
        for angle in np.linspace(turn, turn + math.tau, 12, endpoint=False):
            yield round(ASIDE * math.cos(angle), 3), round(ASIDE * math.sin(angle), 3)

    def _is_free(self, thing: Thing, by: tuple[float, float], standing: Sequence[Thing]) -> bool:
        """Tell whether an object has room on the workspace where it would be moved to."""
        place = thing.position[:2] + np.array(by)
        radius = max(kind.radius for kind in self.subject.loaded.cell_config.objects.values())
        apart = (np.linalg.norm(one.position[:2] - place) for one in standing if one.body != thing.body)
        return self._is_inside(place) and all(distance > 2 * radius for distance in apart)

    def _on_table(self, thing: Thing) -> bool:
        return self._is_inside(thing.position[:2])

    def _is_inside(self, place: Array) -> bool:
        table = self.subject.loaded.cell_config.table
        return all(low <= x <= high for x, (low, high) in zip(place, (table.x, table.y), strict=True))

    @property
    def _path(self) -> Path:
        return find_run(LATEST, self.runs)


def _running(past: Past) -> tuple[str, ...]:
    """Return the skills that were under way when a run was cut off."""
    status = {e["node"]: e["status"] for e in past.entries if e["kind"] == "status" and "item" in e}
    return tuple(node.rpartition("/")[2] for node, said in status.items() if said == "RUNNING")


def _wrong(result: Mapping[str, Any], kill: Kill) -> list[str]:
    """Return what is wrong about how a run ended that was taken up again."""
    problems = []
    if not ledger_agrees(result):
        problems.append(f"the ledger says {result['items']}, the audit {result['audit']}")
    gone = "removed" in kill.change or "fell" in kill.change
    allowed = result["status"] == "SUCCESS" or (gone and result["reason"] == "lost")
    if not allowed:
        problems.append(f"it ended with {result['status']} {result['reason']}: {result['message']}")
    if result["holds"]:
        problems.append(f"the tool holds {result['holds']} at its end")
    return problems


def _twice(past: Past) -> list[str]:
    """Return the items that were handled again after they had been placed."""
    problems, placed = [], Counter[str]()
    last: dict[str, str] = {}
    for entry in past.entries:
        if entry["kind"] != "item":
            continue
        item, state = entry["item"], entry["state"]
        if state == "placed" and last.get(item) != "placed":
            placed[item] += 1
        elif last.get(item) == "placed" and state != "placed":
            problems.append(f"{item} was {state} after it had been placed")
        last[item] = state
    return problems + [f"{item} was placed {count} times" for item, count in placed.items() if count > 1]


def _with(kill: Kill, status: str, problems: Sequence[str]) -> Kill:
    return replace(kill, status=status, problems=tuple(problems))
