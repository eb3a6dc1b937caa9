"""`executive bench journal`: what it measures, and what it prints."""

from __future__ import annotations

import json

from click.testing import CliRunner, Result

from executive.cli.main import main

SMALL = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, ["bench", "journal", "sort_overhead", *SMALL, *words])


def test_is_a_table_on_standard_output(tmp_path):
    shown = invoke("--seed", "5", "--runs", str(tmp_path))
    assert shown.exit_code == 0, shown.output
    names = [line.split()[0] for line in shown.stdout.splitlines()[2:]]
    assert names == ["encode", "write", "sync", "journal", "record", "run"]


def test_as_json_is_one_object(tmp_path):
    figures = json.loads(invoke("--runs", str(tmp_path), "--json").stdout)
    assert figures["entries"] > 50
    assert 0 < figures["append_s"] < figures["wall_s"]


def test_a_place_that_is_a_file_is_bad_input(tmp_path):
    (tmp_path / "runs").write_text("")
    shown = invoke("--runs", str(tmp_path / "runs"))
    assert shown.exit_code == 2
    assert "is a file" in shown.stderr
