"""Deciding a recorded run once more, from what the cell answered then, without the cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.errors import InputError
from executive.events import Event
from executive.mission.load import LoadedMission
from executive.record.entry import entry_of
from executive.record.progress import is_skill, skill_name
from executive.record.recorded_mission import recorded_mission
from executive.replay.input_log import Entry, Past
from executive.replay.input_recorder import Unrecorded
from executive.replay.replayed_cell import PlayedCell
from executive.run.run import Run
from executive.skill import Skill

Decision = Mapping[str, Any]
"""What was decided in a control step, as plain values: its `tick`, `clock` and `kind`, and what it says."""

_SAID = {
    "status": ("node", "status", "reason", "item", "outputs"),
    "choice": ("node", "choice", "reason"),
    "decision": ("item", "label", "bin"),
    "item": ("item", "state", "label", "bin"),
    "intent": ("action",),
}
"""What a decision is made of, by kind of event. Sentences are none of it: they may be worded anew."""


@dataclass(frozen=True)
class Replay:
    """What came of deciding a run once more.

    Attributes:
        decisions: How many were the same.
        ticks: Control steps of the replay.
        recorded: The first decision of the record that was not made again, or None.
        replayed: What was decided instead, or None for nothing.
        edited: Whether the mission is another one than that of the record.
        unanswered: What was asked that the record has no answer to, which ended the replay; or "".
    """

    decisions: int
    ticks: int
    recorded: Decision | None
    replayed: Decision | None
    edited: bool
    unanswered: str = ""

    @property
    def same(self) -> bool:
        """Tell whether everything was decided as before."""
        return self.recorded is None and self.replayed is None

    @property
    def difference(self) -> str:
        """What differs first, in words; "" where nothing does."""
        if self.same:
            return ""
        said = f"the record says {_told(self.recorded)}, and now it is {_told(self.replayed)}"
        if not self.unanswered:
            return said
        return f"{said}: {self.unanswered}; what would come of it only a run can tell"


def replay(
    path: Path, entries: Iterable[Entry], skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> Replay:
    """Decide a run once more and return the first decision that differs.

    The skills, the tree and the ledger are the real ones; the arm, the tool, the camera, the detectors and
    the person are played from the journal. After the first difference the record has no answers any more,
    so nothing is said of what would have come then.

    Args:
        path: The run directory.
        entries: Its journal.
        skills: Installed skills by name.
        mission: Another mission file to decide by; None: the one that was run. For another one only what
            skills do and what is known of items is compared, and no control nodes.

    Raises:
        InputError: The directory holds no run that could be replayed.
    """
    past = Past.of(entries)
    run = past.start
    if run is None or not past.senses:
        raise InputError(
            f'"{path}" holds no run that can be replayed: its journal tells of no answers of a cell'
        )
    loaded = recorded_mission(path, run, skills, mission)
    edited = mission is not None and loaded.text != (path / "mission.yaml").read_text(encoding="utf-8")
    return compare(loaded, skills, past, int(run["seed"]), edited=edited)


def compare(
    loaded: LoadedMission, skills: Mapping[str, type[Skill]], past: Past, seed: int, *, edited: bool = False
) -> Replay:
    """Decide by `loaded` what a past tells of, and return the first decision that differs."""
    comparison = _Comparison(past, edited)
    run = Run(loaded, skills, seed=seed, requests=(), kind=PlayedCell, past=past, observers=[comparison])
    comparison.stop = run.control.stop
    run.execute()
    recorded, replayed = comparison.difference
    return Replay(comparison.same, run.tick, recorded, replayed, edited, comparison.unanswered)


class _Comparison:
    """Compares decisions with those of a past, as they are made; an observer."""

    def __init__(self, past: Past, edited: bool) -> None:
        self._past = past
        self._edited = edited
        self._to_come = [d for entry in past.entries if (d := _decision(entry, edited))]
        # A run that was cut off told of everything but the last control step for sure.
        self._whole = any(entry["kind"] == "end" for entry in past.entries)
        self._over = False
        self.same = 0
        self.difference: tuple[Decision | None, Decision | None] = (None, None)
        self.unanswered = ""
        self.stop = lambda: None

    def __call__(self, event: Event) -> None:
        if event.kind == "fault":
            _, asked, said = event.data["traceback"].partition(f".{Unrecorded.__name__}: ")
            self.unanswered = said.partition("\n")[0] if asked else ""
        if self._over:
            return
        if event.kind == "end":
            self._end()
            return
        decision = _decision(entry_of(event), self._edited)
        if decision is None:
            return
        recorded = self._to_come[self.same] if self.same < len(self._to_come) else None
        if recorded == decision:
            self.same += 1
            return
        self._over = True
        if self._whole or self._counts(decision) or (recorded is not None and self._counts(recorded)):
            self.difference = (recorded, decision)
        self.stop()

    def _end(self) -> None:
        """The replay is at its end: is the record, too?"""
        if self.same < len(self._to_come) and self._counts(self._to_come[self.same]):
            self._over = True
            self.difference = (self._to_come[self.same], None)

    def _counts(self, decision: Decision) -> bool:
        """Tell whether the step of a decision was ended; what was still under way is no decision yet."""
        return bool(decision["tick"] < self._past.last_tick)


def _decision(entry: Entry, edited: bool) -> Decision | None:
    """Return what was decided, or None where nothing was."""
    kind = entry["kind"]
    if kind not in _SAID or (edited and (kind == "choice" or (kind == "status" and not is_skill(entry)))):
        return None
    decision = {"tick": entry["tick"], "clock": entry["clock"], "kind": kind}
    decision |= {key: entry[key] for key in _SAID[kind] if entry.get(key)}
    if edited and "node" in decision:
        decision["node"] = skill_name(decision["node"])
    return decision


def _told(decision: Decision | None) -> str:
    """Return a decision in words."""
    if decision is None:
        return "nothing more"
    said = {key: value for key, value in decision.items() if key not in ("tick", "clock", "kind", "outputs")}
    what = ", ".join(f"{key} {value}" for key, value in said.items())
    return f"at {decision['clock']:.3f} s (step {decision['tick']}) {decision['kind']}: {what}"
