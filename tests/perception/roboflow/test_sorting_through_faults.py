"""Sorting while an inference server fails: the mission goes on, or ends with its reason."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys

import pytest
from stub_server import StubServer, predictions

from executive.mission.load import load_mission
from executive.perception.detectors.embedded import LABELS_PATH, MODEL_PATH
from executive.perception.detectors.onnx_model import OnnxModel, read_labels
from executive.plugins import load_skills
from executive.run.assembly import RunOptions, assemble

SECRET = "SECRET1234567890"
MISSION = """
mission: two_detectors
cell: cells/roboflow.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree:
  repeat:
    until: SelectTarget.no_candidate
    do:
      - retry:
          attempts: 40
          on: [SelectTarget.unseen, SelectTarget.doubtful]
          do: [{use: look}, SelectTarget]
      - [Approach, Grasp, Transit, Release]
trees:
  look:
    - MoveToScan: {pose: next}
    - DETECT
    - Localize
"""
SERVER = "{Detect: {detector: server, view: full, doubtful: pass}}"
FALLBACK = f"""try: {SERVER}
      catch: [{{on: Detect.unavailable, do: {SERVER.replace("server", "embedded")}}}]"""


@pytest.fixture
def stub():
    """A server with the shipped weights."""
    model = OnnxModel(MODEL_PATH, read_labels(LABELS_PATH), threads=1)
    server = StubServer(lambda image: list(predictions(model.detect(image, 0.25))))
    yield server
    server.stop()


@pytest.fixture
def arrange(stub, tmp_path, monkeypatch):
    """A function that writes a mission and returns it with the overrides of its cell."""
    monkeypatch.setenv("ROBOFLOW_API_KEY", SECRET)

    def arrange(detect, objects, deadline):
        path = tmp_path / "two_detectors.yaml"
        path.write_text(MISSION.replace("DETECT", detect))
        return path, {
            "cell.detectors.server.url": stub.url,
            "cell.detectors.server.deadline": f"{deadline}",
            "cell.table.objects": f"[{objects}, {objects}]",
        }

    return arrange


@pytest.fixture
def sort(arrange, stub):
    """A function that sorts objects, with the embedded detector behind a server with faults.

    It returns status, right and misplaced objects. A server that has stopped starts again.
    """

    def sort(faults, objects):
        stub.faults = faults
        events = []

        def restart_server(event):
            events.append(event)
            if stub.over.is_set():
                stub.start()

        path, overrides = arrange(FALLBACK, objects, deadline=1.0)
        loaded = load_mission(path, load_skills(), overrides)
        run = assemble(loaded, RunOptions(1), [restart_server])
        with contextlib.closing(run):
            outcome, truth = run.execute(), run.count_ground_truth()
        assert SECRET not in repr(events)
        return outcome.status, truth["right"], truth["wrong_bin"] + truth["elsewhere"]

    return sort


@pytest.mark.slow
def test_every_fault_in_turn_stops_nothing_where_another_detector_is_there(sort, stub):
    faults = ("401", "500", "broken json", "nan", "hang", "stop", "", "huge")
    assert sort(lambda look: faults[look % len(faults)], objects=4) == ("SUCCESS", 4, 0)
    assert stub.looks >= 4


@pytest.mark.slow
def test_the_key_is_in_no_file_and_no_output(arrange, stub, tmp_path):
    stub.faults = lambda look: "401"
    path, overrides = arrange(SERVER[1:-1], objects=2, deadline=10.0)
    command = [sys.executable, "-m", "executive.cli.main", "run", str(path), "--json", "--runs", "runs"]
    for key, value in overrides.items():
        command += ["--set", f"{key}={value}"]
    ended = subprocess.run(command, cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True)
    result = json.loads(ended.stdout)
    assert (ended.returncode, result["reason"]) == (1, "Detect.unavailable")
    assert "set ROBOFLOW_API_KEY to a key that may use it" in result["message"]
    assert SECRET not in ended.stdout + ended.stderr
    files = [path for path in (tmp_path / "runs").rglob("*") if path.is_file()]
    assert len(files) > 3
    assert not [path for path in files if SECRET.encode() in path.read_bytes()]
