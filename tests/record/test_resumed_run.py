"""Runs that were cut off and are taken up again, on the fake cell."""

from __future__ import annotations

import json
import os
import signal
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from executive.discovery import discover
from executive.errors import InputError
from executive.events import Event
from executive.mission.load import LoadedMission, load_mission
from executive.record.find_run import find_run
from executive.record.journal import read_journal
from executive.record.recorded_run import recorded_run
from executive.record.replay import replay
from executive.record.result import ledger_agrees
from executive.record.resumed_run import resumed_run
from executive.testing.disturbances.hand import Hand
from executive.testing.fake_cell import FakeCell
from executive.testing.substitutes import raising
from tests.meanwhile import meanwhile

SEED = 3


class Cut(BaseException):
    """Ends a run as a kill does, but for what Python itself closes."""


class Cutter:
    """A view that ends the process at the n-th event of a control step, or the first one after it."""

    def __init__(self, tick: int, nth: int = 1) -> None:
        self._tick, self._nth = tick, nth

    def open(self, run: object) -> None:
        """Begin."""

    def __call__(self, event: Event) -> None:
        if event.tick >= self._tick:
            self._nth -= 1
            if self._nth <= 0:
                raise Cut

    def close(self) -> None:
        """End."""

    def note(self, sentence: str) -> None:
        """Hear nothing."""


def load(missions: Path, name: str) -> LoadedMission:
    return load_mission(missions / f"{name}.yaml", discover())


def cut_off(loaded: LoadedMission, runs: Path, **options: Any) -> Path:
    """Begin a run that is cut off, and return its directory."""
    kind = options.pop("kind", FakeCell)
    requests = [*loaded.routes] * 4
    with pytest.raises(Cut):
        recorded_run(
            loaded, discover(), seed=SEED, runs=runs, kind=kind, requests=requests, frames=False, **options
        )
    return find_run("latest", runs)


def resumed(path: Path) -> dict[str, Any]:
    return resumed_run(path, discover(), frames=False, kind=FakeCell)


def placed(path: Path) -> Counter[str]:
    """How often each item came into a bin."""
    states: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for entry in read_journal(path / "journal.jsonl"):
        if entry["kind"] == "item":
            if entry["state"] == "placed" != states.get(entry["item"]):
                counts[entry["item"]] += 1
            states[entry["item"]] = entry["state"]
    return counts


MISSIONS = ("sort_overhead", "sort_wrist", "kit_fasteners", "pick_on_request")
CASES = [(name, after) for name in MISSIONS for after in (1, 333, 700, 1100)]


@pytest.mark.parametrize(
    ("name", "after"),
    [pytest.param(*case, marks=[] if case == ("sort_overhead", 700) else pytest.mark.slow) for case in CASES],
)
def test_it_ends_as_if_nothing_had_happened(missions: Path, tmp_path: Path, name: str, after: int) -> None:
    loaded = load(missions, name)
    whole = recorded_run(
        loaded,
        discover(),
        seed=SEED,
        runs=tmp_path,
        kind=FakeCell,
        requests=[*loaded.routes] * 4,
        frames=False,
    )
    path = cut_off(loaded, tmp_path, views=[Cutter(after)])
    result = resumed(path)
    assert (result["status"], result["items"]) == (whole["status"], whole["items"])
    assert ledger_agrees(result)
    assert set(placed(path).values()) <= {1}
    # And the whole of it, the cut included, can be decided once more.
    assert replay(path, read_journal(path / "journal.jsonl"), discover()).difference == ""
    assert json.loads((path / "result.json").read_text()) == result


@pytest.mark.slow
@settings(
    max_examples=4,
    deadline=None,
    # Each run takes a second: shrinking would take long.
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.integers(0, 2700), st.integers(1, 12))
@example(444, 7)
def test_in_the_middle_of_a_control_step_it_may_be_cut_off_too(
    missions: Path, tmp_path_factory: pytest.TempPathFactory, tick: int, nth: int
) -> None:
    path = cut_off(
        load(missions, "sort_overhead"), tmp_path_factory.mktemp("runs"), views=[Cutter(tick, nth)]
    )
    result = resumed(path)
    assert result["status"] == "SUCCESS"
    assert result["items"]["placed"] == result["items"]["seen"] == result["audit"]["right"]
    assert set(placed(path).values()) == {1}
    assert replay(path, read_journal(path / "journal.jsonl"), discover()).difference == ""


@pytest.mark.slow
def test_it_may_be_cut_off_again_and_again(missions: Path, tmp_path: Path) -> None:
    path = cut_off(load(missions, "sort_overhead"), tmp_path, views=[Cutter(300)])
    for after in (301, 800, 1500):
        with pytest.raises(Cut):
            resumed_run(path, discover(), frames=False, kind=FakeCell, views=[Cutter(after)])
    result = resumed(path)
    assert result["status"] == "SUCCESS"
    assert set(placed(path).values()) == {1}
    assert [e["kind"] for e in read_journal(path / "journal.jsonl")].count("resume") == 4
    assert replay(path, read_journal(path / "journal.jsonl"), discover()).difference == ""


def changed(
    missions: Path, runs: Path, after: int, act: Callable[[Hand], None]
) -> tuple[Path, dict[str, Any]]:
    """Cut a run off, change the world, and take the run up again."""
    loaded = load(missions, "sort_overhead")
    path = cut_off(loaded, runs, views=[Cutter(after)])
    meanwhile(path / "world.log", loaded, SEED, act, FakeCell)
    return path, resumed(path)


def moments(missions: Path, runs: Path, skill: str) -> list[int]:
    """Control steps in the middle of each activation of a skill in the whole run."""
    loaded = load(missions, "sort_overhead")
    recorded_run(loaded, discover(), seed=SEED, runs=runs, kind=FakeCell, frames=False)
    begun, found = 0, []
    for entry in read_journal(find_run("latest", runs) / "journal.jsonl"):
        if entry["kind"] == "status" and entry["node"].endswith(f"/{skill}"):
            if entry["status"] == "RUNNING":
                begun = entry["tick"]
            else:
                found.append((begun + entry["tick"]) // 2)
    return found


@pytest.mark.parametrize("skill", [pytest.param("Grasp", marks=pytest.mark.slow), "Transit"])
def test_what_fell_from_the_tool_is_picked_again(missions: Path, tmp_path: Path, skill: str) -> None:
    fell: list[str] = []

    def act(hand: Hand) -> None:
        assert hand.held is not None
        fell.append(hand.held.label)
        hand.part()

    path, result = changed(missions, tmp_path, moments(missions, tmp_path, skill)[1], act)
    assert fell
    assert (result["status"], ledger_agrees(result)) == ("SUCCESS", True)
    assert result["items"]["placed"] == 6
    assert set(placed(path).values()) == {1}


def test_a_run_that_was_halted_goes_on(missions: Path, tmp_path: Path) -> None:
    class Stopper(Cutter):
        def __call__(self, event: Event) -> None:
            if event.kind == "item" and event.data["state"] == "held":
                os.kill(os.getpid(), signal.SIGINT)

    loaded = load(missions, "sort_overhead")
    halted = recorded_run(
        loaded, discover(), seed=SEED, runs=tmp_path, kind=FakeCell, views=[Stopper(0, 0)], frames=False
    )
    assert (halted["status"], bool(halted["holds"])) == ("HALTED", True)
    path = find_run("latest", tmp_path)
    result = resumed(path)
    assert (result["status"], result["items"]["placed"]) == ("SUCCESS", 6)
    assert set(placed(path).values()) == {1}
    entries = read_journal(path / "journal.jsonl")
    assert replay(path, entries, discover()).difference == ""
    since = [entry["kind"] for entry in entries].index("resume")
    ahead = [entry["ahead"] for entry in entries[since:] if entry["kind"] == "plan"]
    assert sum(ahead) == 6 + 5, "on the cell itself the ways into bins and to next targets are planned ahead"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Detect", "Grasp"])
def test_a_run_that_a_bug_has_ended_goes_on_once_it_is_mended(
    missions: Path, tmp_path: Path, name: str
) -> None:
    skills = discover()
    buggy = {**skills, name: raising(skills[name], ZeroDivisionError("a bug"), after=3)}
    loaded = load_mission(missions / "sort_overhead.yaml", buggy)
    first = recorded_run(loaded, buggy, seed=SEED, runs=tmp_path, kind=FakeCell, frames=False)
    assert (first["status"], "a bug" in first["message"]) == ("FAULT", True)
    run = Path(first["run"])
    again = resumed_run(run, buggy, frames=False, kind=FakeCell)
    assert again["message"] == first["message"], "it is not mended yet"
    result = resumed(run)
    assert (result["status"], result["audit"]["right"]) == ("SUCCESS", result["items"]["seen"])
    assert max(placed(run).values()) == 1


def test_there_must_be_something_to_take_up(missions: Path, tmp_path: Path) -> None:
    loaded = load(missions, "sort_overhead")
    recorded_run(loaded, discover(), seed=SEED, runs=tmp_path, kind=FakeCell, frames=False)
    path = find_run("latest", tmp_path)
    with pytest.raises(InputError, match=r"came to its end: SUCCESS; there is nothing to take up again"):
        resumed(path)
    (path / "journal.jsonl").write_text("")
    with pytest.raises(InputError, match=r"had not begun when it was cut off; run the mission anew"):
        resumed(path)
    with pytest.raises(InputError, match=r'"nowhere" is no run directory, .* the last ones there: 20'):
        find_run("nowhere", tmp_path)
    with pytest.raises(InputError, match=r"there is none at all; say where they are with --runs DIR"):
        find_run("latest", tmp_path / "empty")


def test_a_mission_that_is_decided_otherwise_now_is_not_gone_on_with(missions: Path, tmp_path: Path) -> None:
    path = cut_off(load(missions, "inspect_then_sort"), tmp_path, views=[Cutter(900)])
    file = path / "mission.yaml"
    old, new = "try: {SelectTarget: {prefer: surest}}", "try: SelectTarget"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError, match=r"cannot be taken up again: the record says at .* and now it is"):
        resumed(path)
