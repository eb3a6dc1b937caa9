"""The helper process is always there, whatever happens to it, and never keeps anybody waiting."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from executive.errors import Fault, Unavailable
from executive.perception.detectors.roboflow import inference_process as module
from executive.perception.detectors.roboflow.inference_process import ApiKey, InferenceProcess, NoAnswer

HERE = Path(__file__).parent
SECRET = "SECRET1234567890"
IMAGE = np.zeros((500, 500, 3), np.uint8)
"""More bytes than a pipe holds."""


@pytest.fixture
def start(monkeypatch):
    """Starts a helper whose program misbehaves in a way."""
    monkeypatch.setattr(module, "PROGRAM", "scripted_program")
    key = ApiKey({**os.environ, "PYTHONPATH": str(HERE), "ROBOFLOW_API_KEY": SECRET})
    started = []

    def start(how):
        started.append(InferenceProcess({"how": how}, key))
        return started[-1]

    yield start
    for helper in started:
        helper.close()


def list_children():
    """The processes of this one that have not been waited for."""
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


def ask(helper, patience=0.05):
    helper.wait_until_ready()
    return helper.request(IMAGE, time.monotonic() + patience)


@pytest.mark.parametrize("how", ["deaf", "mute"])
def test_without_an_answer_it_gives_up_in_time_and_has_another_process_and_nothing_else(start, how):
    before = set(list_children())
    helper = start(how)
    helper.wait_until_ready()
    (first,) = set(list_children()) - before
    assert os.getsid(int(first)) != os.getsid(0), "Ctrl-C reaches it"
    start_time = time.monotonic()
    with pytest.raises(NoAnswer):
        helper.request(IMAGE, start_time + 0.2)
    assert 0.2 <= time.monotonic() - start_time < 1.0

    def count_resources():
        return len(list_children()), threading.active_count(), len(os.listdir("/proc/self/fd"))

    held = count_resources()
    for _ in range(3):
        with pytest.raises(NoAnswer):
            ask(helper, 0.005)
    assert count_resources() == held
    assert first not in list_children()
    helper.close()
    assert set(list_children()) == before


@pytest.mark.parametrize(
    ("how", "kind", "text"),
    [
        ("never ready", Unavailable, "was not ready within 0 s"),
        ("unusable", Unavailable, "cannot be used: ImportError: no inference_sdk; `exec"),
        ("is killed", Unavailable, "ended by signal 9"),
        ("ends", Fault, r"ended with status 3: ZeroDivisionError: \*\*\*"),
    ],
)
def test_a_process_that_ends_or_is_never_ready_is_reported_without_the_key_and_replaced(
    start, monkeypatch, how, kind, text
):
    if how == "never ready":
        monkeypatch.setattr(module, "STARTUP_TIMEOUT", 0.1)
    helper = start(how)
    for _ in range(2):
        with pytest.raises(kind, match=text):
            ask(helper, 5.0)


def test_neither_what_it_prints_nor_an_answer_too_deep_to_read_stops_it(start, capfd):
    assert ask(start("talks"), 5.0)["answer"] == {"width": 500, "height": 500}
    assert capfd.readouterr() == ("", "")
    assert ask(start("nests"), 5.0) == {"failure": "invalid", "detail": "the answer is nested too deeply"}


def test_without_room_for_a_process_it_is_unavailable_until_there_is(start, monkeypatch):
    def full(*args, **options):
        raise OSError(11, "Resource temporarily unavailable")

    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", full)
        helper = start("talks")
        with pytest.raises(Unavailable, match="not running: resource temporarily unavailable"):
            ask(helper)
    assert "answer" in ask(helper, 5.0)


def test_stopping_it_ends_a_call_under_way(start):
    helper = start("mute")
    helper.wait_until_ready()
    with ThreadPoolExecutor(1) as thread:
        call = thread.submit(helper.request, IMAGE, time.monotonic() + 60)
        helper.stop()
        assert str(call.exception(5.0)) == "its helper process was ended by signal 9"
    with pytest.raises(Unavailable, match="not running: the detector is closed"):
        helper.wait_until_ready()


@pytest.mark.slow
def test_it_ends_with_its_parent_though_its_server_hangs():
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"http://127.0.0.1:{server.getsockname()[1]}"
        parent = subprocess.Popen(
            [sys.executable, "-c", ORPHANING, url], stdout=subprocess.PIPE, cwd=HERE.parents[2], text=True
        )
        with parent.stdout:
            parent.stdout.readline()
        (process_id,) = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
        child = os.pidfd_open(int(process_id))
        connection, _ = server.accept()
        with connection:
            parent.send_signal(signal.SIGKILL)
            parent.wait()
            ended = select.select([child], [], [], 10.0)[0]
            os.close(child)
    assert ended, "the helper outlives its parent"


ORPHANING = """
import sys, time
import numpy as np
from executive.perception.detectors.roboflow.inference_process import ApiKey, InferenceProcess

helper = InferenceProcess({"url": sys.argv[1], "model_id": "a/1", "api": "v1", "confidence": 0.5}, ApiKey())
print("started", flush=True)
helper.wait_until_ready()
helper.request(np.zeros((8, 8, 3), np.uint8), time.monotonic() + 60)
"""
