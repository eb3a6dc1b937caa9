"""`executive run --resume` and `executive replay`, by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from at_terminal import invoke


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.mark.slow
def test_a_run_whose_journal_lost_its_end_is_refused(runs: Path) -> None:
    assert invoke("run", "sort_fruit", "--seed", "4", "--quiet", "--runs", str(runs)).exit_code == 0
    path = (runs / "latest").resolve()
    (path / "result.json").unlink()
    lines = (path / "journal.jsonl").read_text().splitlines(keepends=True)
    early = [line for line in lines if json.loads(line).get("clock", 0.0) <= 1.0]
    (path / "journal.jsonl").write_text("".join(early))
    refused = invoke("run", "--resume", "latest", "--runs", str(runs), "--json")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "lacks later commands" in refused.stderr


@pytest.mark.slow
def test_a_replay_says_what_is_decided_otherwise(runs: Path, tmp_path: Path) -> None:
    assert invoke("run", "sort_fruit", "--seed", "4", "--quiet", "--runs", str(runs)).exit_code == 0
    path = (runs / "latest").resolve()
    same = invoke("replay", "latest", "--runs", str(runs))
    assert same.exit_code == 0
    assert f"decisions, all as recorded ({path})" in same.stderr
    edited = path / "edited.yaml"
    edited.write_text((path / "mission.yaml").read_text().replace("prefer: surest", "prefer: nearest"))
    other = invoke("replay", str(path), "--mission", str(edited), "--json")
    assert other.exit_code == 1
    printed = json.loads(other.stdout)
    differences = printed["same"], printed["edited"], printed["recorded"]["kind"]
    assert differences == (False, True, "TargetSelected")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "give a MISSION, or a run with --resume RUN"),
        (
            ("sort_fruit", "--resume", "latest"),
            "--resume takes mission, seed, params, requests, cell and scene",
        ),
        (("--resume", "latest", "--scene", "dim.yaml"), "--resume takes mission, seed, params"),
        (("--resume", "nowhere"), '"nowhere" is no run directory'),
    ],
)
def test_what_makes_no_sense_is_refused(words: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    refused = invoke("run", *words, "--runs", str(tmp_path))
    assert refused.exit_code == 2
    assert sentence in refused.output
