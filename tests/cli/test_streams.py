"""Commands whose standard streams are closed, full or cut off."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from at_terminal import invoke

EXECUTIVE = f'"{sys.executable}" -m executive.cli.main'


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a line of bash in a folder."""
    return subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120)


def run_with(streams: str, folder: Path, words: str = "sort_overhead --set cell.kind=fake --seed 3") -> dict:
    """Run a mission with redirected streams and return its result file and the exit code."""
    done = shell(f"{EXECUTIVE} run {words} --json --runs runs {streams}", folder)
    result = json.loads((folder / "runs/latest/result.json").read_text())
    result["exit_code"] = done.returncode
    return {key: result[key] for key in ("status", "items", "trace", "exit_code")}


@pytest.mark.slow
@pytest.mark.parametrize("streams", [">&-", "2>/dev/full", "2> >(head -3 >/dev/null)", "<&- >&- 2>&-"])
def test_a_stream_that_fails_changes_neither_run_nor_exit_code(streams: str, tmp_path: Path) -> None:
    expected = run_with(">/dev/null 2>/dev/null", tmp_path)
    assert expected["exit_code"] == 0
    assert run_with(streams, tmp_path) == expected


def test_control_characters_of_a_file_are_shown_escaped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text('mission: "\\e[2Jred"\ntree: "\\e]0;title\\a"\n')
    for words in (["check", "m.yaml"], ["check", "m.yaml", "--json"], ["run", "m.yaml"]):
        done = invoke(*words)
        assert done.exit_code == 2
        assert "\\u001b]0;title\\u0007" in done.output
        assert not any(character in done.output for character in "\x1b\x07\x9b")
