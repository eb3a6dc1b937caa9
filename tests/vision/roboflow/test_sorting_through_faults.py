"""A sort goes on whatever the inference server does, or ends with its declared reason; no secret gets out."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stub_server import BODIES, SPOILT, StubServer, predictions

from executive.discovery import discover
from executive.events import Event
from executive.mission.load import load_mission
from executive.runtime.run import Run
from executive.vision.detectors.embedded import LABELS, MODEL
from executive.vision.detectors.onnx_model import OnnxModel, read_labels

SECRET = "SECRET1234567890"
NOTHING_WRONG = {"wrong_bin": 0, "elsewhere": 0}
STATUSES = ("401", "403", "404", "413", "429", "500", "502", "503")
LIES = ("swapped", "doubtful")
"""Answers that are right in form and wrong in content, which only another detector can tell."""
QUICK = (*STATUSES, *sorted(BODIES), *sorted(set(SPOILT) - set(LIES)))
"""Faults that show at once."""


@pytest.fixture(scope="module")
def stub():
    """A server with the shipped weights."""
    model = OnnxModel(MODEL, read_labels(LABELS), threads=1)
    server = StubServer(lambda image: list(predictions(model.detect(image, 0.25))))
    yield server
    server.stop()


@pytest.fixture
def mission(missions: Path, tmp_path: Path) -> Path:
    """`sort_overhead` with one word changed: its cell."""
    text = (missions / "sort_overhead.yaml").read_text().replace("cells/overhead", "cells/roboflow")
    path = tmp_path / "sort_overhead.yaml"
    path.write_text(text)
    return path


def settings(stub: StubServer, objects: int = 2, **further: str) -> dict[str, str]:
    """Return the overrides of the cell: the stub server, so many objects, and what is asked for."""
    return {
        "cell.detectors.server.url": stub.url,
        "cell.detectors.server.deadline": "10.0",
        "cell.table.objects": f"[{objects}, {objects}]",
        **{f"cell.detectors.{key.replace('__', '.')}": value for key, value in further.items()},
    }


@pytest.fixture
def sort(stub: StubServer, mission: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Sorts objects while the server has faults; returns outcome, truth and all that was told."""
    monkeypatch.setenv("ROBOFLOW_API_KEY", SECRET)

    def sort(
        faults: Callable[[int], str],
        told: Callable[[Event], None] = lambda event: None,
        objects: int = 2,
        **further: str,
    ) -> tuple[Any, dict[str, int], list[Event]]:
        stub.looks, stub.faults = 0, faults
        events: list[Event] = []
        loaded = load_mission(mission, discover(), settings(stub, objects, **further))
        run = Run(loaded, discover(), seed=1, observers=[events.append, told])
        try:
            outcome, truth = run.execute(), run.audit()
        finally:
            run.close()
            if stub.over.is_set():
                stub.start()
        assert SECRET not in repr(events)
        assert truth is not None
        return outcome, dict(truth), events

    return sort


def test_every_fault_in_turn_stops_nothing_where_another_detector_is_there(sort: Any, stub: Any) -> None:
    faults = ("401", "500", "broken json", "html", "null", "nan", "huge")
    outcome, truth, _ = sort(lambda look: faults[look % len(faults)], objects=4, eye__failures="1000")
    assert (outcome.status, truth) == ("SUCCESS", {**truth, **NOTHING_WRONG, "right": 4})
    assert stub.looks >= len(faults)


def test_a_server_that_hangs_and_dies_is_used_again_when_it_is_back(sort: Any, stub: Any) -> None:
    dead = []

    def told(event: Event) -> None:
        if stub.over.is_set() and not dead:
            dead.append(event.clock)
        if dead and stub.over.is_set() and event.clock > dead[0] + 2.0:
            stub.start()

    faults = {2: "hang", 3: "stop"}
    outcome, truth, _ = sort(
        lambda look: faults.get(look, ""), told, objects=4,
        server__deadline="0.5", eye__rest="2.0", eye__failures="1",
    )  # fmt: skip
    assert (outcome.status, truth) == ("SUCCESS", {**truth, **NOTHING_WRONG, "right": 4})
    assert dead
    assert stub.looks > 3


def test_a_server_that_never_answers_fails_the_look_when_its_deadline_has_passed(sort: Any) -> None:
    outcome, truth, events = sort(
        lambda look: "hang", eye__detectors="[server]", eye__failures="1000", server__deadline="1.0"
    )
    assert (outcome.status, outcome.reason) == ("FAILURE", "Detect.unavailable")
    assert "server: no answer within 1.0 s from http://127.0.0.1" in outcome.message
    looks = [e for e in events if e.data.get("node", "").endswith("/Detect")]
    asked = next(e.clock for e in looks)
    failed = next(e.clock for e in looks if e.data["status"] == "FAILURE")
    assert 1.0 <= failed - asked <= 1.3
    assert truth == {**truth, **NOTHING_WRONG}


def test_the_key_is_in_no_file_and_no_output(stub: StubServer, mission: Path, tmp_path: Path) -> None:
    stub.looks, stub.faults = 0, lambda look: "401"
    overrides = settings(stub, eye__detectors="[server]")
    command = [sys.executable, "-m", "executive.cli.main", "run", str(mission), "--json", "--runs", "runs"]
    for key, value in overrides.items():
        command += ["--set", f"{key}={value}"]
    environment = {**os.environ, "ROBOFLOW_API_KEY": SECRET}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    result = json.loads(ended.stdout)
    assert (ended.returncode, result["reason"]) == (1, "Detect.unavailable")
    assert "set ROBOFLOW_API_KEY to a key that may use it" in result["message"]
    assert SECRET not in ended.stdout + ended.stderr
    files = [path for path in (tmp_path / "runs").rglob("*") if path.is_file()]
    assert len(files) > 3
    assert not [path for path in files if SECRET.encode() in path.read_bytes()]


@pytest.mark.parametrize("lie", ["swapped", pytest.param("doubtful", marks=pytest.mark.campaign)])
def test_a_server_that_lies_in_every_look_stops_nothing_where_another_detector_sees_the_same(
    sort: Any, stub: Any, lie: str
) -> None:
    outcome, truth, _ = sort(lambda look: lie, eye__failures="1000")
    assert (outcome.status, truth) == ("SUCCESS", {**truth, **NOTHING_WRONG, "right": 2})
    assert stub.looks > 2


@pytest.mark.campaign
@pytest.mark.parametrize("fault", [*QUICK, "hang", "drip", "stop"])
@pytest.mark.parametrize("detectors", ["[both, embedded]", "[server, embedded]", "[server]"])
def test_each_fault_for_the_whole_run(sort: Any, fault: str, detectors: str) -> None:
    outcome, truth, _ = sort(lambda look: fault, eye__detectors=detectors)
    if "embedded" in detectors or fault == "strangers":
        assert (outcome.status, truth) == ("SUCCESS", {**truth, **NOTHING_WRONG, "right": 2})
    else:
        assert (outcome.status, outcome.reason) == ("FAILURE", "Detect.unavailable")
        assert truth == {**truth, **NOTHING_WRONG}


@pytest.mark.campaign
@pytest.mark.parametrize("fault", [*QUICK, "hang", "drip"])
def test_each_fault_from_the_third_look_on(sort: Any, fault: str) -> None:
    outcome, truth, _ = sort(lambda look: fault if look > 2 else "", eye__detectors="[server]")
    assert truth == {**truth, **NOTHING_WRONG}
    if fault != "strangers":
        assert (outcome.status, outcome.reason) == ("FAILURE", "Detect.unavailable")


@pytest.mark.campaign
@pytest.mark.parametrize("lies", [(1,), (2, 5), (3, 4), (10,)])
def test_wrong_classes_in_a_few_looks_are_outvoted(sort: Any, lies: tuple[int, ...]) -> None:
    outcome, truth, _ = sort(lambda look: "swapped" if look in lies else "", eye__detectors="[server]")
    assert (outcome.status, truth) == ("SUCCESS", {**truth, **NOTHING_WRONG, "right": 2})


@pytest.mark.campaign
def test_wrong_classes_in_every_look_are_believed_for_nobody_says_otherwise(sort: Any) -> None:
    _, truth, _ = sort(lambda look: "swapped", eye__detectors="[server]")
    assert truth == {**truth, "wrong_bin": 2}
