"""`executive init`: a new project in which everything works, and what it refuses to overwrite."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.cli.setup import (
    FOLDERS,
    PACKAGE,
    TEMPLATE,
    check_package_name,
    make_package_name,
    write_project,
)
from executive.errors import InputError

FILES = [
    ".gitignore", "README.md", "cells/table.yaml", "hall/__init__.py", "hall/check_seal.py", "pyproject.toml",
    "sort.yaml", "tests/test_check_seal.py",
]  # fmt: skip
BIN = Path(sys.executable).parent


def init(*words: str) -> Result:
    return invoke("init", *words)


def called(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Call a command as a shell in a folder does, without what pytest tells its children."""
    inner = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return subprocess.run(
        [str(BIN / words[0]), *words[1:]], cwd=folder, env=inner, capture_output=True, text=True, check=False
    )


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_it_says_what_is_there_now_and_what_to_type() -> None:
    result = init("hall")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        f"hall: {', '.join(FILES)}",
        f"Type, after `. {BIN}/activate`:",
        "  cd hall && executive run sort.yaml",
        "  pytest",
    ]
    assert (
        sorted(str(path.relative_to("hall")) for path in Path("hall").rglob("*") if path.is_file()) == FILES
    )


def test_its_code_is_as_tidy_as_this_project(missions: Path) -> None:
    write_project(Path("hall"), "hall")
    config = missions.parent / "pyproject.toml"
    linted = called("ruff", "check", "--config", str(config), "hall", folder=Path("hall"))
    assert linted.returncode == 0, linted.stdout
    formatted = called("ruff", "format", "--check", "--config", str(config), ".", folder=Path("hall"))
    assert formatted.returncode == 0, formatted.stdout


@pytest.mark.parametrize("mission", ["sort_fasteners", "sort_fruit", "tray_instruments"])
def test_a_project_can_begin_with_a_shipped_mission(mission: str) -> None:
    made = init("hall", "--from", mission)
    assert made.stdout.splitlines()[0] == (
        f"hall: .gitignore, README.md, cells/table.yaml, {mission}.yaml, tests/test_mission.py"
    )
    assert f"  cd hall && executive run {mission}.yaml" in made.stdout
    (checked,) = json.loads(invoke("check", f"hall/{mission}.yaml", "--json").stdout)
    assert checked["findings"] == []


def test_a_project_begins_with_one_thing() -> None:
    assert "exclude each other" in init("hall", "--from", "sort_fruit", "--urdf", "arm.urdf").stderr
    assert 'shipped mission "sort_friut"' in init("hall", "--from", "sort_friut").stderr
    assert not Path("hall").exists()


@pytest.mark.slow
def test_everything_works_at_once_and_its_tests_find_a_broken_skill() -> None:
    made = called("executive", "init", "hall", folder=Path())
    assert made.returncode == 0, made.stderr
    hall = Path("hall")
    run = called("executive", "run", "sort.yaml", folder=hall)
    assert run.returncode == 0, run.stderr
    assert "SUCCESS" in run.stderr and "CheckSeal [" in run.stderr
    tests = called("pytest", "-q", folder=hall)
    assert tests.returncode == 0, tests.stdout
    skill = hall / "hall" / "check_seal.py"
    skill.write_text(skill.read_text().replace("force < self.min_force", "force > self.min_force"))
    tests = called("pytest", "-q", folder=hall)
    assert tests.returncode == 1
    assert re.search(r"^FAILED .*::test_an_object_with_a_weak_seal_is_released", tests.stdout, re.MULTILINE)


@pytest.mark.parametrize(
    ("held", "folder", "expected"),
    [
        (["hall/.git", "hall/a", "hall/b"], "hall", "is not empty: it contains .git and 2 more"),
        (["hall"], "hall", '"hall" is a file; name a folder that is empty or does not exist\n'),
        (["notes"], "notes/hall", "notes/hall/.gitignore cannot be written: not a directory"),
        ([], "random", "random.py; give another name with --name"),
    ],
)
def test_where_no_project_can_be_everything_stays_as_it_is(
    held: list[str], folder: str, expected: str
) -> None:
    for name in held:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text("mine")
    result = init(folder)
    assert (result.exit_code, result.stdout) == (2, "")
    assert expected in result.stderr
    assert sorted(str(path) for path in Path().rglob("*") if path.is_file()) == held


@pytest.mark.parametrize(
    ("folder", "name"),
    [("demo", "demo"), ("Blue-Table", "blue_table"), ("a b.c", "a_b_c"), ("x/line_2", "line_2"), ("q", "q")],
)
def test_the_package_is_named_after_the_folder(folder: str, name: str) -> None:
    assert make_package_name(Path(folder)) == name


@pytest.mark.parametrize("folder", ["3d", "_x", "x_", "tisch-grün", "a+b", "-"])
def test_a_folder_that_names_no_package_is_refused(folder: str) -> None:
    with pytest.raises(InputError, match="a package name starts with a letter, continues with letters"):
        make_package_name(Path(folder))


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("class", "it is a Python keyword"),
        ("tests", "the project has another folder of this name"),
        ("random", "a module of this name is already installed: .*random.py"),
    ],
)
def test_a_name_that_is_taken_is_refused(name: str, why: str) -> None:
    end = "; give another name with --name$"
    with pytest.raises(InputError, match=f'^a package cannot be called "{name}": {why}{end}'):
        check_package_name(name, "")
    assert {path.name for path in TEMPLATE.iterdir() if path.is_dir()} - {PACKAGE} < set(FOLDERS)
