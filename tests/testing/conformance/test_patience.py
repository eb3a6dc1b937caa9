"""What does not come back is broken off, and told by skill, check and line."""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from conforming_skills import Pause, Push
from stuck_skills import Clutching, Despairing, Looping, Pondering

from executive.skill import Skill
from executive.testing.conformance import Stage, conformance
from executive.testing.conformance.check import Check, NotConforming, Verdict
from executive.testing.conformance.patience import Stuck, patience

PATIENCE = 0.6
ADVICE = "The arm waits for every tick: yield in each loop that waits, and leave long work to a detector."


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Wait for a short time only, and see that nobody's timer is left behind."""
    monkeypatch.setattr("executive.testing.conformance.patience.PATIENCE", PATIENCE)
    answered = signal.getsignal(signal.SIGALRM)
    yield
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0
    assert signal.getsignal(signal.SIGALRM) is answered


def checks_of(skill: type[Skill]) -> dict[str, Check]:
    return {check.name: check for check in conformance(skill)}


def told(verdict: Verdict) -> list[str]:
    """Return what is wrong, lines aside."""
    return [re.sub(r"\.py:\d+", ".py:{line}", problem) for problem in verdict.problems]


def test_a_tick_that_loops_for_ever_is_told_once_and_what_needs_it_is_not_run() -> None:
    checks = checks_of(Looping)
    verdict = checks["ticks_come_back"].verdict()
    said = (
        "with an empty tool at tick 1 Looping did not come back for 0.6 s, at stuck_skills.py:{line}. "
        f"{ADVICE}"
    )
    assert (verdict.status, told(verdict)) == ("failed", [said])
    tries = checks["ticks_come_back"].case.tries
    later = checks["ends_as_declared"].verdict()
    assert (later.status, told(later)) == ("not run", [said])
    assert checks["halts_at_rest"].verdict().status == "not run"
    assert checks["class_documented"].verdict().status == "ok"
    assert checks["halts_at_rest"].case.tries == tries == 1, "nobody waits twice"
    with pytest.raises(NotConforming, match="Looping did not come back"):
        checks["halts_at_once"]()


def test_what_only_loops_when_something_goes_wrong_is_tried_where_all_is_well() -> None:
    checks = checks_of(Despairing)
    verdict = checks["ticks_come_back"].verdict()
    assert told(verdict) == [
        "with an empty tool while every item is given up at tick 1 Despairing did not come back for 0.6 s, "
        f"at stuck_skills.py:{{line}}. {ADVICE}"
    ]
    assert checks["ends_as_declared"].verdict().status == "ok"
    assert checks["adversity_ends_as_declared"].verdict().status == "not run"


def test_what_does_not_come_back_from_a_halt_says_so() -> None:
    assert told(checks_of(Clutching)["ticks_come_back"].verdict()) == [
        "with an empty tool at tick 1, halted there, Clutching did not come back for 0.6 s, "
        f"at stuck_skills.py:{{line}}. {ADVICE}"
    ]


def test_whatever_else_a_check_asks_of_a_skill_is_broken_off_too() -> None:
    verdict = checks_of(Pondering)["never_sooner_than_shortest"].verdict()
    assert (verdict.status, told(verdict)) == ("failed", [
        "what Pondering.never_sooner_than_shortest asks of it did not come back for 0.6 s, "
        "at stuck_skills.py:{line}. Whatever is asked of a skill is answered at once."
    ])  # fmt: skip


def test_whoever_arranges_a_stage_for_ever_is_told_so() -> None:
    def arrange(stage: Stage) -> Mapping[str, Any]:
        while True:
            pass

    checks = {check.name: check for check in conformance(Pause, arrange)}
    assert checks["arranged"].verdict().problems == (
        "Pause cannot be tried: what arranges it did not come back for 0.6 s",
    )
    assert checks["ends_as_declared"].verdict().status == "not run"


def test_a_skill_that_takes_long_tick_by_tick_is_left_in_peace() -> None:
    ticks = iter(range(10**9))
    began = threading.Event()
    threading.Timer(3 * PATIENCE, began.set).start()
    with patience(Push, lambda: next(ticks)):
        began.wait(6 * PATIENCE)
    assert began.is_set()


def test_a_timer_of_somebody_else_goes_off_in_its_time() -> None:
    rung = []
    answered = signal.signal(signal.SIGALRM, lambda *_: rung.append(True))
    signal.setitimer(signal.ITIMER_REAL, PATIENCE / 2)
    try:
        with pytest.raises(Stuck), patience(Push, lambda: 0):
            threading.Event().wait(5 * PATIENCE)
        threading.Event().wait(PATIENCE / 2)
    finally:
        signal.signal(signal.SIGALRM, answered)
    assert rung == [True]


def test_in_another_thread_a_skill_is_tried_all_the_same() -> None:
    found = []
    thread = threading.Thread(target=lambda: found.append(checks_of(Pause)["ends_as_declared"].verdict()))
    thread.start()
    thread.join()
    assert [verdict.status for verdict in found] == ["ok"]
