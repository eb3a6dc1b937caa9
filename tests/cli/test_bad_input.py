"""What `check` and `run` print about files and names that are wrong; nothing is run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.text.files import list_shipped_missions

MISSION = """\
mission: small
cell: cells/overhead.yaml
params: {attempts: 4}
routes: {cube: red_bin}
tree: [MoveToScan, Detect, Localize, {retry: {attempts: $attempts, do: Detect}}]
"""
FINDING = f"""\
m.yaml:5:28: error[unknown-skill]: there is no skill "Localise"
   5 | tree: [MoveToScan, Detect, Localise, {{retry: {{attempts: $attempts, do: Detect}}}}]
     |                            ^^^^^^^^
  Did you mean "Localize"? Installed skills: {", ".join(load_skills())}.
"""
SHIPPED = f"Shipped missions: {', '.join(list_shipped_missions())}.\n"


@pytest.fixture(autouse=True)
def _in_a_folder_with_a_mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MISSION)


def test_a_mistake_is_printed_by_check_and_run_and_nothing_is_run() -> None:
    assert invoke("check", "m.yaml").stdout.startswith("m.yaml: ok\n")
    Path("m.yaml").write_text(MISSION.replace("Localize", "Localise"))
    checked = invoke("check", "m.yaml")
    ran = invoke("run", "m.yaml", "--runs", "runs")
    assert (checked.exit_code, checked.stdout, checked.stderr) == (2, FINDING, "")
    assert (ran.exit_code, ran.stdout, ran.stderr) == (2, "", FINDING)
    assert not Path("runs").exists()


def test_a_finding_in_json_shows_a_part_of_a_long_line() -> None:
    Path("m.yaml").write_text(MISSION.replace("[MoveToScan", f"[{'x' * 1000}"))
    (report,) = json.loads(invoke("check", "m.yaml", "--json").stdout)
    assert report["findings"][0]["excerpt"] == f"tree: [{'x' * 133}"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("sort_overhed", f'no shipped mission "sort_overhed". Did you mean "sort_overhead"? {SHIPPED}'),
        (".", '"." is a folder, not a file\n'),
        ("9" * 300, f'no shipped mission "{"9" * 197}…". {SHIPPED}'),
    ],
)
def test_a_missing_name_is_reported_with_the_existing_names(name: str, expected: str) -> None:
    for command in ("run", "check"):
        result = invoke(command, name)
        assert result.exit_code == 2
        assert result.output.endswith(expected)


def test_a_request_for_an_unknown_class_is_refused() -> None:
    ran = invoke("run", "m.yaml", "--request", "cube", "--request", "banana", "--runs", "runs")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert 'cannot pick "banana"; ask for one of: cube' in ran.stderr
