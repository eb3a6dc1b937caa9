"""Missions with a mistake, each with the findings that its author has to be told, and no others.

Every file in `broken` begins with its findings: `# finds: LINE:COL error[code]`, or
`# finds: FILE:LINE:COL error[code]` where the mistake is in its cell or library. Line 0 is the whole file.
`findings.txt` holds their words; `python tests/mission/test_broken_missions.py` writes it again.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.cli.shared import keep_stdout_clean
from executive.mission.load import CheckerFinder, load_mission
from executive.skill import Skill
from executive.station.check import load_checker
from executive.text.findings import MEANING_BY_CODE, Finding, MissionError

FOLDER = Path(__file__).parent / "broken"
BROKEN = sorted(FOLDER.glob("*.yaml"))
EXPECTED = re.compile(
    r"# finds: (?:(?P<path>.+):)?(?P<line>\d+):(?P<col>\d+) (?P<severity>\w+)\[(?P<code>.+)\]"
)

WORDS = Path(__file__).with_name("findings.txt")

Look = Callable[[Path], tuple[Finding, ...]]


class Place(NamedTuple):
    """What a finding is checked by."""

    path: str
    line: int
    col: int
    severity: str
    code: str


@pytest.fixture(autouse=True)
def there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in the folder of the broken missions, so that paths are as short as their author's."""
    monkeypatch.chdir(FOLDER)


def rendered(path: Path, findings: Iterable[Finding]) -> str:
    """Return the findings of a file under its name, as `findings.txt` holds them."""
    text = "\n".join(map(str, findings)).replace(str(FOLDER.parents[2]), "")
    return f"# {path.name}\n{text}\n"


@pytest.fixture(scope="module")
def look(shared_cells: None) -> Look:
    """What is wrong with a mission; each is loaded once."""
    skills = load_skills()
    kind = functools.cache(load_checker)
    return functools.cache(lambda path: findings_of(path, skills, kind))


def findings_of(
    path: Path, skills: dict[str, type[Skill]], kind: CheckerFinder = load_checker
) -> tuple[Finding, ...]:
    """Return the findings of a mission."""
    try:
        return load_mission(path, skills, find_checker=kind).warnings
    except MissionError as error:
        return error.findings


def expected(path: Path) -> Iterator[Place]:
    """Yield the findings that the head of a file asks for."""
    for line in path.read_text().splitlines():
        if not (found := EXPECTED.fullmatch(line)):
            return
        file = found["path"] or path.name
        yield Place(file, int(found["line"]), int(found["col"]), found["severity"], found["code"])


@pytest.mark.parametrize("path", BROKEN, ids=lambda path: path.stem)
def test_exactly_the_expected_findings_are_found_and_underlined(path: Path, look: Look) -> None:
    found = [Place(f.path, f.line, f.col, f.severity, f.code) for f in look(path)]
    assert found == list(expected(path)), "\n".join(map(str, look(path)))
    assert rendered(path, look(path)) in WORDS.read_text(encoding="utf-8")
    assert path.stem.startswith(("many-", *{place.code for place in found}))
    for finding in look(path):
        head, *shown = str(finding).splitlines()
        if finding.line == 0:
            assert head.startswith(f"{finding.path}: ")
            continue
        line = Path(finding.path).read_text().split("\n")[finding.line - 1]
        number, excerpt = shown[0].split(" | ", 1)
        blank, carets = re.fullmatch(r" +\| (\s*)(\^+)", shown[1]).groups()
        assert head.startswith(f"{finding.path}:{finding.line}:{finding.col}: ")
        assert int(number) == finding.line
        assert excerpt in line
        assert line.index(excerpt) + len(blank) == finding.col - 1
        assert len(blank + carets) <= max(len(excerpt), len(blank) + 1)


def test_the_command_prints_what_is_found_and_refuses_to_go_on(look: Look) -> None:
    mistakes = FOLDER / "many-in-three-files.yaml"
    result = invoke("check", mistakes.name)
    assert result.exit_code == 2
    assert result.output.splitlines() == "\n".join(map(str, look(mistakes))).splitlines()


def test_every_kind_of_finding_has_a_broken_mission() -> None:
    codes = set(MEANING_BY_CODE)
    assert {place.code for path in BROKEN for place in expected(path)} == codes


if __name__ == "__main__":
    os.chdir(FOLDER)
    with keep_stdout_clean():
        skills = load_skills()
        kind = functools.cache(load_checker)
        texts = [rendered(path, findings_of(path, skills, kind)) for path in BROKEN]
    WORDS.write_text("".join(texts), encoding="utf-8")
