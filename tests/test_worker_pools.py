"""Processes that work for another one: what reaches them, and how they end."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from executive.processes import WorkerPool

PARENT = """\
import multiprocessing, signal
from executive.processes import WorkerPool

if __name__ == "__main__":
    pool = WorkerPool(1)
    pool.submit(signal.getsignal, signal.SIGINT).result()
    (worker,) = multiprocessing.active_children()
    print(worker.pid, flush=True)
    {then}
"""


def wait_until(true) -> None:
    """Return as soon as something is true; it has to be within a time that no machine needs."""
    deadline = time.monotonic() + 30.0
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def has_ended(process: int) -> bool:
    """Tell whether a process that is nobody's child here works no more."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the worker in /proc")
@pytest.mark.parametrize(
    "then", ["pool.submit(signal.pause).result()", "signal.pause()"], ids=["a busy one", "an idle one"]
)
def test_a_worker_ends_when_its_parent_is_killed(tmp_path: Path, then: str) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT.format(then=then))
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert parent.stdout is not None
    with parent:
        worker = int(parent.stdout.readline())
        assert not has_ended(worker)
        parent.kill()
    wait_until(lambda: has_ended(worker))


def test_who_leaves_the_pool_by_an_exception_does_not_wait_for_the_work() -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), WorkerPool(2) as pool:
        for _ in range(4):
            pool.submit(time.sleep, 600.0)
        raise KeyboardInterrupt
    assert time.monotonic() - began < 60.0
    assert multiprocessing.active_children() == []


def test_libraries_in_a_process_of_a_pool_use_one_thread(monkeypatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with WorkerPool(1) as pool:
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
