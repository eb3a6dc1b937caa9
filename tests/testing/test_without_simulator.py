"""The tests of skills need no simulator; that none of them asks for it, their conftest makes sure."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

COLLECT = """\
import sys

import pytest

code = pytest.main(["--collect-only", "-q", "-p", "no:cacheprovider", "tests/skills"])
print(int(code), "pybullet" in sys.modules, "executive.sim.cell" in sys.modules)
"""


def test_what_the_tests_of_skills_import_brings_no_simulator() -> None:
    done = subprocess.run([sys.executable, "-c", COLLECT], capture_output=True, text=True, cwd=ROOT)
    assert "test_pick_and_place.py" in done.stdout, done.stderr
    assert done.stdout.splitlines()[-1] == "0 False False"
