"""Start and end of a command: the modules that a check imports, and the end of the process of a run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

UNUSED_MODULES = {
    "PIL", "av", "executive.record",
    "executive.replay", "executive.run.run", "executive.view", "inference_sdk", "jinja2", "onnxruntime",
    "executive.drivers.sim", "pybullet", "pybullet_data", "rich", "scipy", "supervision", "torch",
}  # fmt: skip
"""Modules that only runs, views and training need."""
PROGRAM = """
import sys
from executive.cli.main import main
try:
    main(["check", "sort_overhead", "--set", "cell.kind=fake"])
except SystemExit as end:
    print("exit code", end.code, *sorted(set(sys.argv[1:]) & set(sys.modules)), file=sys.stderr)
"""


def test_a_check_imports_only_the_modules_that_it_uses() -> None:
    arguments = [sys.executable, "-c", PROGRAM, *UNUSED_MODULES]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == ["exit code 0"]


LISTEN = """
import threading
from executive.skill import Skill

class Listen(Skill):
    '''Leave a thread.'''

    def run(self, cell):
        threading.Thread(target=threading.Event().wait, name="ear").start()
"""


@pytest.mark.slow
def test_no_library_reports_a_leak_at_the_end_of_a_run(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "executive.cli.main", "run", "sort_overhead", "--quiet"]
    options = ["--set", "cell.table.objects=[1,1]", "--runs", str(tmp_path)]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=True)
    assert done.stderr == ""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "sweep"])
def test_a_thread_that_a_skill_leaves_is_named_and_keeps_no_process_alive(
    command: str, tmp_path: Path
) -> None:
    (tmp_path / "pyproject.toml").write_text(
        '[project]\nname = "mine"\n[project.entry-points."executive.skills"]\nListen = "mine:Listen"\n'
    )
    (tmp_path / "mine.py").write_text(LISTEN)
    mission = tmp_path / "listen.yaml"
    mission.write_text("mission: listen\ncell: cells/overhead.yaml\ntree:\n  - Listen\n")
    seeds = ["--seeds", "2"] if command == "sweep" else ["--quiet"]
    arguments = [command, str(mission), *seeds, "--set", "cell.kind=fake", "--json"]
    program = [sys.executable, "-m", "executive.cli.main", *arguments]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, isinstance(json.loads(done.stdout), dict)) == (0, True)
    assert 'without waiting for its threads, still running after 5 s: "ear"' in done.stderr
