"""Start and end of a command: the modules that a check imports, and messages at the end of a run."""

from __future__ import annotations

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


@pytest.mark.slow
def test_no_library_reports_a_leak_at_the_end_of_a_run(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "executive.cli.main", "run", "sort_overhead", "--quiet"]
    options = ["--set", "cell.table.objects=[1,1]", "--runs", str(tmp_path)]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=True)
    assert done.stderr == ""
