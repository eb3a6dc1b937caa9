"""Programs of this project are this project's, wherever they are started."""

from __future__ import annotations

import subprocess

from executive.processes import build_command


def test_a_file_in_the_working_directory_is_not_run_in_place_of_a_library(tmp_path) -> None:
    for name in ("cv2", "numpy", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('somebody else')\n")
    (tmp_path / "executive").mkdir()
    (tmp_path / "executive" / "__init__.py").write_text("raise SystemExit('somebody else')\n")
    ended = subprocess.run(
        build_command("executive.perception.detectors.roboflow"),
        cwd=tmp_path,
        input=b"",
        capture_output=True,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, b"")
