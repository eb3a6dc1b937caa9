"""Objects of the applications: their generator makes the shipped files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

MAX_SIZE = 2_000_000
"""Maximum size of all shipped objects [byte]."""


def test_the_generator_makes_the_shipped_files(missions: Path, tmp_path: Path) -> None:
    folder = missions / "cells" / "objects"
    for program in ("make_objects.py", "make_others.py"):
        subprocess.run([sys.executable, folder / program, tmp_path], check=True)
    shipped = {path.relative_to(folder): path.read_bytes() for path in folder.glob("*/*.*")}
    made = {path.relative_to(tmp_path): path.read_bytes() for path in tmp_path.glob("*/*.*")}
    assert shipped == made
    assert sum(map(len, shipped.values())) <= MAX_SIZE
