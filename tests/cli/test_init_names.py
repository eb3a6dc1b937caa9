"""What a new project's package may be called, and what is said of other names."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cli.init.names import FOLDERS, package_name, require_free
from executive.cli.init.project import PACKAGE, TEMPLATE
from executive.errors import InputError


@pytest.mark.parametrize(
    ("folder", "name"),
    [("demo", "demo"), ("Blue-Table", "blue_table"), ("a b.c", "a_b_c"), ("x/line_2", "line_2"), ("q", "q")],
)
def test_it_is_made_from_the_name_of_the_folder(folder: str, name: str) -> None:
    assert package_name(Path(folder)) == name


def test_the_working_directory_has_a_name_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hall").mkdir()
    monkeypatch.chdir(tmp_path / "hall")
    assert package_name(Path()) == "hall"


@pytest.mark.parametrize("folder", ["3d", "_x", "x_", "tisch-grün", "a+b", "-"])
def test_a_folder_that_names_no_package_is_refused(folder: str) -> None:
    with pytest.raises(InputError) as caught:
        package_name(Path(folder))
    assert str(caught.value) == (
        f'the folder "{folder}" names no package: such a name begins with a letter, goes on with letters, '
        'digits and "_", and does not end with "_"; give another name with --name'
    )


def test_a_name_that_is_given_must_be_right_as_it_is() -> None:
    with pytest.raises(InputError, match=r'^--name "Blue-Table" names no package: such a name begins with '):
        require_free("Blue-Table", '--name "Blue-Table"')


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("class", "that is a word of Python's own"),
        ("executive", "that is a package of the executive"),
        ("skills", "that is a package of the executive"),
        ("tests", "that is another folder of the project"),
        ("cells", "that is another folder of the project"),
        ("runs", "that is another folder of the project"),
        ("random", "that is a module of Python's standard library"),
    ],
)
def test_a_name_that_is_taken_is_refused(name: str, why: str) -> None:
    with pytest.raises(InputError) as caught:
        package_name(Path(name))
    assert str(caught.value) == f'a package cannot be called "{name}": {why}; give another name with --name'


def test_the_name_of_an_installed_module_is_refused() -> None:
    with pytest.raises(InputError, match=r'"numpy": a module of that name is installed already, /.*numpy'):
        package_name(Path("numpy"))


def test_a_folder_without_python_takes_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hall_of_nothing").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    assert package_name(Path("hall_of_nothing")) == "hall_of_nothing"


def test_no_folder_of_the_template_can_be_taken_for_the_package() -> None:
    folders = {path.name for path in TEMPLATE.iterdir() if path.is_dir()} - {PACKAGE}
    assert folders < set(FOLDERS)
