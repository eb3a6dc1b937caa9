"""`executive run --resume` and `executive replay`, by the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import main


def invoke(*words: str):
    return CliRunner().invoke(main, words)


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.mark.slow
def test_a_run_that_was_cut_off_is_taken_up_again_and_ends(runs: Path) -> None:
    assert invoke("run", "sort_fruit", "--seed", "4", "--quiet", "--runs", str(runs)).exit_code == 0
    path = (runs / "latest").resolve()
    (path / "result.json").unlink()
    lines = (path / "journal.jsonl").read_text().splitlines(keepends=True)
    early = [line for line in lines if json.loads(line).get("clock", 0.0) <= 1.0]
    (path / "journal.jsonl").write_text("".join(early))
    done = invoke("run", "--resume", "latest", "--runs", str(runs), "--json")
    # The log of the world is longer than the journal: the objects in the bins are counted first.
    assert done.exit_code == 0, done.output
    assert re.search(r"note: the journal ends \d+ control steps .* before the log of the world", done.stderr)
    result = json.loads(done.stdout)
    assert (result["status"], result["seed"], result["run"]) == ("SUCCESS", 4, str(path))
    assert "sort_fruit.yaml --seed 4" in done.stderr
    again = invoke("replay", path.name, "--runs", str(path.parent), "--json")
    assert (again.exit_code, json.loads(again.stdout)["same"]) == (0, True)
    assert invoke("run", "--resume", str(path)).exit_code == 2


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
        (("sort_fruit", "--resume", "latest"), "--resume takes mission, seed, params, requests and scene"),
        (("--resume", "latest", "--scene", "dim.yaml"), "--resume takes mission, seed, params"),
        (("--resume", "nowhere"), '"nowhere" is no run directory'),
    ],
)
def test_what_makes_no_sense_is_refused(words: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    refused = invoke("run", *words, "--runs", str(tmp_path))
    assert refused.exit_code == 2
    assert sentence in refused.output
