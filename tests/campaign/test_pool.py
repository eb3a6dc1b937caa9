"""Many jobs in processes of their own."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator

import pytest

from executive.campaign.pool import JobOptions, run_jobs
from executive.run.run_control import RunControl
from executive.run.signals import HALT_SIGNALS, halt_on_signals


def half(number: int) -> float:
    """Return half of an even number."""
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number / 2


def why(number: int, error: BaseException) -> str:
    return f"{number}: {error}"


def test_every_job_is_done_and_the_results_are_in_their_order() -> None:
    calls: list[tuple[int, int]] = []
    stored: list[tuple[int, float | str, int]] = []
    results = run_jobs(
        [4, 3, 2, 2], half, why, JobOptions(on_progress=lambda done, all: calls.append((done, all))),
        lambda *result: stored.append(result),
    )  # fmt: skip
    assert (results, calls) == ([2.0, "3: 3 is odd", 1.0, 1.0], [(1, 4), (2, 4), (3, 4), (4, 4)])
    assert sorted(stored) == [(index, result, 0) for index, result in enumerate(results)]
    assert run_jobs([], half, why) == []


def halt(how: signal.Signals) -> str:
    """Do a job during which somebody wishes to halt, and which goes on until it is asked to halt itself."""
    control = RunControl()
    with halt_on_signals(control):
        os.kill(os.getppid(), how)
        while not control.is_stopped:
            time.sleep(0.01)
    return "halted in good order"


@pytest.fixture
def heard() -> Iterator[None]:
    """Hear SIGINT: what a shell runs in the background begins with it ignored."""
    before = {number: signal.signal(number, signal.default_int_handler) for number in HALT_SIGNALS}
    yield
    assert all(signal.getsignal(number) is signal.default_int_handler for number in HALT_SIGNALS)
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_who_halts_this_process_alone_halts_the_runs_under_way(how: signal.Signals) -> None:
    calls: list[str] = []
    results = run_jobs([how] * 3, halt, why, JobOptions(1, on_halt=lambda: calls.append("halting")))
    assert (results, calls) == (["halted in good order", None, None], ["halting"])


def deaf(how: signal.Signals) -> str:
    """Do a job during which somebody wishes to halt, and which never does."""
    os.kill(os.getppid(), how)
    signal.pause()
    return "was not to be waited for"


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_second_wish_ends_the_jobs_under_way_at_once(how: signal.Signals) -> None:
    with pytest.raises(KeyboardInterrupt):
        run_jobs([how] * 3, deaf, why, JobOptions(1, on_halt=lambda: os.kill(os.getpid(), how)))
    assert multiprocessing.active_children() == []


def die_with_it(how: signal.Signals) -> str:
    """Do a job whose process is ended, together with its parent."""
    os.kill(os.getppid(), how)
    os.kill(os.getpid(), signal.SIGTERM)
    return "dead"


@pytest.mark.usefixtures("heard")
def test_a_job_whose_process_was_ended_with_this_one_has_no_result() -> None:
    assert run_jobs([signal.SIGTERM] * 2, die_with_it, why, JobOptions(1)) == [None, None]
