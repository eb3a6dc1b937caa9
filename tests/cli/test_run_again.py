"""`executive run --resume` and `executive replay`, by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from at_terminal import invoke

FAKE = ("--set", "cell.kind=fake")


@pytest.mark.slow
def test_a_replay_says_what_is_decided_otherwise(tmp_path: Path) -> None:
    assert invoke("run", "sort_fruit", *FAKE, "--seed", "4", "--quiet", "--runs", tmp_path).exit_code == 0
    path = (tmp_path / "latest").resolve()
    same = invoke("replay", "latest", "--runs", tmp_path)
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
