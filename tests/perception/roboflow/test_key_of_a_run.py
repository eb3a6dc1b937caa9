"""A run with an inference server that fails: its reason, and the secrecy of the key."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from stub_server import StubServer

SECRET = "SECRET1234567890"
MISSION = """
mission: one_look
cell: cells/roboflow.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree: [MoveToScan, {Detect: {detector: server, view: full}}, Localize]
"""


@pytest.mark.slow
def test_the_key_is_in_no_file_and_no_output(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOFLOW_API_KEY", SECRET)
    (tmp_path / "one_look.yaml").write_text(MISSION)
    server = StubServer(lambda image: [], lambda look: "401")
    command = [sys.executable, "-m", "executive.cli.main", "run", "one_look.yaml", "--json", "--runs", "runs"]
    options = [
        "--set",
        f"cell.detectors.server.url={server.url}",
        "--set",
        "cell.detectors.server.deadline=10",
    ]
    ended = subprocess.run(
        [*command, *options], cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True
    )
    server.stop()
    result = json.loads(ended.stdout)
    assert (ended.returncode, result["reason"]) == (1, "Detect.unavailable")
    assert "set ROBOFLOW_API_KEY to a key that may use it" in result["message"]
    assert SECRET not in ended.stdout + ended.stderr
    files = [path for path in (tmp_path / "runs").rglob("*") if path.is_file()]
    assert len(files) > 3
    assert not [path for path in files if SECRET.encode() in path.read_bytes()]
