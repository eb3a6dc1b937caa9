"""The project in whose folder one works: which it is, and what is said of one that is wrong."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.plugins import find_project

Write = Callable[[str], Path]

SKILLS = '[project.entry-points."executive.skills"]\n'


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Write the pyproject.toml of the working directory and return its path."""
    monkeypatch.chdir(tmp_path)

    def write(text: str) -> Path:
        file = tmp_path / "pyproject.toml"
        file.write_text(text)
        return file

    return write


def registers(group: str = "executive.skills") -> dict[str, str]:
    project = find_project()
    assert project is not None
    return project.read_entries(group)


def test_it_says_what_it_registers(write: Write) -> None:
    file = write(f'[project]\nname = "Blue-Table"\n{SKILLS}Wave = "blue.wave:Wave"\n')
    project = find_project()
    assert project is not None
    assert (project.file, project.name) == (file, "Blue-Table")
    assert project.read_entries("executive.skills") == {"Wave": "blue.wave:Wave"}
    assert project.read_entries("executive.drivers") == {}


def test_it_is_that_of_the_nearest_file_upwards(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write("")
    folder = file.parent / "inner" / "missions"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    assert (found := find_project()) is not None and found.file == file
    nearer = folder.parent / "pyproject.toml"
    nearer.write_text("")
    assert (found := find_project()) is not None and found.file == nearer


@pytest.mark.parametrize(("mode", "counts"), [(0o1777, False), (0o777, True), (0o755, True)])
def test_a_file_in_a_folder_that_is_everybodys_does_not_count(write: Write, mode: int, counts: bool) -> None:
    file = write("")
    file.parent.chmod(mode)
    found = find_project()
    assert (found is not None and found.file == file) == counts


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[project\n", "is not valid TOML: "),
        ("[project]\nentry-points = 3\n", ': [project.entry-points."executive.skills"] is not a table'),
        (f'{SKILLS}Wave = "blue.wave"\n', "\"Wave\" is not the import path of a class: 'blue.wave'"),
        (f"{SKILLS}Wave = 3\n", '"Wave" is not the import path of a class: 3'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_the_file(write: Write, text: str, says: str) -> None:
    file = write(text)
    with pytest.raises(InputError, match=f"^{re.escape(str(file))}.*{re.escape(says)}"):
        registers()


def test_a_file_that_is_no_text_is_refused(write: Write) -> None:
    file = write("")
    file.write_bytes(b'name = "\xff"')
    with pytest.raises(InputError, match=f"^{re.escape(str(file))} is not UTF-8 text: byte 8 is invalid$"):
        find_project()
