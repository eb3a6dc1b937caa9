"""Files that are too large to be checked, and lists of findings that are too long to be read."""

from __future__ import annotations

import json

import pytest
from at_terminal import invoke

from executive.text.findings import MAX_PRINTED_FINDINGS

HEAD = "mission: m\ncell: cells/overhead.yaml\nroutes: {cube: red_bin}\n"


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Check a mission and return the exit code and standard output."""
    monkeypatch.chdir(tmp_path)

    def run(text: str, *options: str) -> tuple[int, str]:
        (tmp_path / "m.yaml").write_text(text)
        done = invoke("check", "m.yaml", *options)
        return done.exit_code, done.stdout

    return run


def test_the_first_findings_are_printed_and_the_others_counted(check):
    text = HEAD + "tree: [" + ", ".join(f"Skill{number}" for number in range(1200)) + "]\n"
    code, shown = check(text)
    assert code == 2
    assert shown.count("error[unknown-skill]") == MAX_PRINTED_FINDINGS
    assert shown.endswith("and 950 more findings; `executive check --json` lists up to 1000\n")
    (report,) = json.loads(check(text, "--json")[1])
    assert len(report["findings"]) == 1000
