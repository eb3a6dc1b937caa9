# ruff: noqa: E501 - findings are quoted as they are printed
"""What a user reads who gave something wrong: one sentence at the right place, never a traceback.

Every case changes the shipped mission or its cell in one place and runs the real commands on it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import main
from executive.mission.text.file_search import list_shipped_missions
from executive.plugins import load_skills

MISSION = """\
mission: small
description: Put everything into its bin.
cell: cells/overhead.yaml
params: {attempts: 4}
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}

tree:
  - MoveToScan
  - Detect
  - Localize
  - SelectTarget: {prefer: nearest}
  - retry:
      attempts: $attempts
      on: [Grasp.missed]
      do: [Approach, Grasp]
  - Transit
  - Release
"""


@dataclass(frozen=True)
class Case:
    """One mistake.

    Attributes:
        expected: All that is printed; LINE stands for the line in which the cell file is changed.
        mission: Text in the mission file, and what stands there instead.
        cell: The same for the cell file.
    """

    expected: str
    mission: tuple[str, str] = ("", "")
    cell: tuple[str, str] = ("", "")


CASES = {
    "a YAML syntax error": Case(
        """
        m.yaml:5:7: error[yaml]: not valid YAML: while parsing a flow mapping that began in line 4: expected ',' or '}', but got ':'
           5 | routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
             |       ^
          Close the bracket or brace.
        """,
        mission=("{attempts: 4}", "{attempts: 4"),
    ),
    "an unknown skill": Case(
        f"""
        m.yaml:10:5: error[unknown-skill]: there is no skill "Localise"
          10 |   - Localise
             |     ^^^^^^^^
          Did you mean "Localize"? Installed skills: {", ".join(load_skills())}.
        """,
        mission=("- Localize", "- Localise"),
    ),
    "an unknown key in the cell file": Case(
        """
        cells/overhead.yaml:LINE:1: error[unknown-key]: the file has no key "ledgre"
        LINE | ledgre: {gate: 0.03}
             | ^^^^^^
          Did you mean "ledger"? Keys of the file: base, cell, description, kind, arm, tool, motion, table, bins, cameras, detector, detectors, localization, objects, unknown, ledger, safe_place.
        """,
        cell=("safe_place:", "ledgre: {gate: 0.03}\nsafe_place:"),
    ),
    "a bin out of reach": Case(
        """
        cells/overhead.yaml:LINE:13: error[robot]: the bin "red_bin" is out of reach: the tool cannot reach (1.480, -0.580, 0.160) m: its wrist would be 1.590 m from the shoulder, 0.770 m beyond the reach of the arm (0.82 m)
        LINE |   red_bin: {position: [1.54, -0.48, 0.0], size: [0.24, 0.30, 0.06], colour: [0.75, 0.15, 0.15]}
             |             ^^^^^^^^
        """,
        cell=("red_bin: {position: [0.24,", "red_bin: {position: [1.54,"),
    ),
}


@pytest.fixture
def write(tmp_path: Path, missions: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Write the mission as m.yaml beside its cell file, each changed in one place, and go there.

    The function returns the line in which the cell file was changed.
    """
    monkeypatch.chdir(tmp_path)
    Path("cells").mkdir()
    original = (missions / "cells" / "overhead.yaml").read_text()

    def write(mission: tuple[str, str] = ("", ""), cell: tuple[str, str] = ("", "")) -> int:
        assert mission[0] in MISSION
        assert cell[0] in original
        Path("m.yaml").write_text(MISSION.replace(*mission, 1))
        Path("cells/overhead.yaml").write_text(original.replace(*cell, 1))
        return original[: original.index(cell[0])].count("\n") + 1

    return write


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, words)


def test_the_mission_that_all_cases_change_is_sound(write: Callable[..., int]) -> None:
    write()
    assert invoke("check", "m.yaml").stdout.startswith("m.yaml: ok\n")


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_mistake_in_a_file_is_reported_once_and_nothing_moves(
    write: Callable[..., int], case: Case
) -> None:
    line = write(case.mission, case.cell)
    expected = dedent(case.expected).lstrip("\n").replace(":LINE:", f":{line}:").replace("LINE", f"{line:4}")
    checked = invoke("check", "m.yaml")
    assert (checked.exit_code, checked.stderr) == (2, "")
    assert checked.stdout == expected
    ran = invoke("run", "m.yaml", "--runs", "runs")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr == expected
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        (
            "atempts=5",
            """
            --set:1:1: error[unknown-param]: the mission has no param "atempts"
               1 | atempts=5
                 | ^^^^^^^
              Did you mean "attempts"? Params of the mission: attempts.
            """,
        ),
        (
            "cell.tols.cup_radius=0.01",
            """
            --set:1:22: error[unknown-key]: the cell has no key "tols"
               1 | cell.tols.cup_radius=0.01
                 |                      ^^^^
              Did you mean "tool"? Keys of the cell: base, cell, description, kind, arm, tool, motion, table, bins, cameras, detector, detectors, localization, objects, unknown, ledger, safe_place.
            """,
        ),
    ],
)
def test_a_wrong_override_is_shown_as_it_was_given(
    write: Callable[..., int], override: str, expected: str
) -> None:
    write()
    ran = invoke("run", "m.yaml", "--set", override)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr == dedent(expected).lstrip("\n")


def test_a_finding_in_json_shows_a_part_of_a_long_line(write: Callable[..., int]) -> None:
    write(("- Localize", f"- {'x' * 1000}"))
    (report,) = json.loads(invoke("check", "m.yaml", "--json").stdout)
    assert [finding["excerpt"] for finding in report["findings"]] == [f"  - {'x' * 136}"]


@pytest.mark.slow
def test_a_whole_process_says_the_same_and_ends_with_the_same_code(write: Callable[..., int]) -> None:
    write(("- Localize", "- Localise"))
    done = subprocess.run(
        [sys.executable, "-m", "executive.cli.main", "run", "m.yaml"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == dedent(CASES["an unknown skill"].expected).lstrip("\n")


SHIPPED = f"Shipped missions: {', '.join(list_shipped_missions())}.\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("sort_overhed", f'there is no mission file and no shipped mission "sort_overhed". Did you mean "sort_overhead"? {SHIPPED}'),
        ("nowhere.yaml", f'there is no mission file and no shipped mission "nowhere.yaml". {SHIPPED}'),
        ("cells", '"cells" is a folder; give the path of one of its files\n'),
        ("9" * 300, f'there is no mission file and no shipped mission "{"9" * 197}…". {SHIPPED}'),
        ("m.yaml --request cube --request banana", 'cannot pick "banana"; ask for one of: cube, sphere, duck\n'),
    ],
)  # fmt: skip
def test_a_missing_name_is_reported_with_the_existing_names(
    write: Callable[..., int], words: str, expected: str
) -> None:
    write()
    ran = invoke("run", *words.split(), "--runs", "runs")
    assert (ran.exit_code, ran.stdout, ran.stderr) == (2, "", expected)
    if "--request" not in words:
        checked = invoke("check", words)
        assert (checked.exit_code, checked.stdout, checked.stderr) == (2, expected, "")
