"""What is registered: by installed packages, and by the project one works in."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from executive.behaviours import load_behaviour, load_skills
from executive.errors import InputError
from executive.perception.detectors.detector_registry import find_detector_kinds
from executive.plugins import list_entries
from executive.station.check import load_checker

Write = Callable[..., Path]
Install = Callable[[str, str], None]

WAVE = 'from executive.skill import Skill\n\n\nclass Wave(Skill):\n    """Wave."""\n'


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Make the working directory a project with a package, which registers in these groups."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)

    def make(package: str, text: str, *, name: str = "", **groups: str) -> Path:
        (tmp_path / package).mkdir()
        (tmp_path / package / "part.py").write_text(text)
        tables = [f'[project.entry-points."executive.{group}"]\n{line}\n' for group, line in groups.items()]
        file = tmp_path / "pyproject.toml"
        file.write_text("".join([f'[project]\nname = "{name or package}"\n', *tables]))
        return file

    yield make
    for module in set(sys.modules) - before:
        del sys.modules[module]


@pytest.fixture
def packages(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., None]:
    """Install a package that registers skills, as far as its metadata go."""

    def install(name: str, entries: str) -> None:
        folder = tmp_path_factory.mktemp("site")
        info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[executive.skills]\n{entries}\n")
        monkeypatch.syspath_prepend(str(folder))

    return install


def test_a_skill_of_the_project_is_found_beside_the_installed_ones(project: Write) -> None:
    project("hall_one", WAVE, skills='Wave = "hall_one.part:Wave"')
    found = load_skills()
    assert found["Wave"].__doc__ == "Wave."
    assert "Grasp" in found
    assert list(found) == sorted(found)


def test_drivers_and_kinds_of_detectors_are_found_likewise(project: Write) -> None:
    project(
        "hall_four", "class Bench:\n    check = print\n\n\nclass Eye:\n    pass\n",
        drivers='bench = "hall_four.part:Bench"', detectors='eye = "hall_four.part:Eye"',
    )  # fmt: skip
    assert load_checker("bench").kind.__name__ == "Bench"
    assert find_detector_kinds()["eye"].load().__name__ == "Eye"


@pytest.mark.parametrize(
    ("group", "kind", "ask"),
    [
        ("skills", "skill", lambda: load_skills()["wave"]),
        ("drivers", "driver", lambda: load_checker("wave")),
        ("detectors", "kind of detector", lambda: find_detector_kinds()["wave"].load()),
    ],
)
@pytest.mark.parametrize(
    ("text", "error"),
    [("import nowhere\n", "ModuleNotFoundError"), ("raise SystemExit(0)\n", "SystemExit: 0")],
)
def test_what_cannot_be_loaded_is_named_with_place_and_file(
    project: Write, group: str, kind: str, ask: Callable[[], object], text: str, error: str
) -> None:
    file = project("hall_five", text, **{group: 'wave = "hall_five.part:Wave"'})
    with pytest.raises(InputError) as caught:
        ask()
    assert f'the {kind} "wave" (hall_five.part:Wave) cannot be loaded: {error}' in str(caught.value)
    assert f"in {file.parent}/hall_five/part.py:1; correct it, or remove it from {file}" in str(caught.value)


def test_one_name_is_registered_once(project: Write, packages: Install) -> None:
    project("hall_six", WAVE, skills='Wave = "hall_six.part:Wave"')
    packages("other", "Wave = other:Wave")
    with pytest.raises(InputError, match=r"registered twice, by hall_six\.part:Wave and other:Wave"):
        load_skills()


def test_of_a_project_that_is_installed_its_file_counts(project: Write, packages: Install) -> None:
    project("hall_seven", WAVE, name="Hall.Seven", skills='Wave = "hall_seven.part:Wave"')
    packages("hall-seven", "Wave = hall_seven.old:Wave\nGone = hall_seven.gone:Gone")
    found = list_entries("executive.skills", "skill")
    assert found["Wave"].value == "hall_seven.part:Wave"
    assert "Gone" not in found


@pytest.mark.parametrize(
    ("text", "problem"), [("Wave = 3\n", "is neither a subclass of Skill"), ("class Wave(\n", "SyntaxError")]
)
def test_a_module_without_the_skill_is_refused(project: Write, text: str, problem: str) -> None:
    project("hall_three", text, skills='Wave = "hall_three.part:Wave"')
    with pytest.raises(InputError, match=problem):
        load_skills()["Wave"]


NOD = """
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success


class Nod(Behaviour):
    "Nod."

    def __init__(self, name, times: int = 1):
        super().__init__(name)

    def update(self):
        raise NotImplementedError


class Shake(Nod):
    "Shake."


class Unfinished(Behaviour):
    "Has no update."
"""


def test_a_mission_may_name_behaviours_of_py_trees_and_of_modules_that_register_a_skill(
    project: Write,
) -> None:
    project("hall_ten", NOD, skills='Nod = "hall_ten.part:Nod"')
    assert load_behaviour("hall_ten.part:Nod") is load_skills()["Nod"]
    assert load_behaviour("hall_ten.part:Shake").__doc__ == "Shake."
    assert load_behaviour("py_trees.timers:Timer").__name__ == "Timer"


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("os:system", 'a mission may not import "os"'),
        ("hall_eleven.other:Nod", 'a mission may not import "hall_eleven.other"'),
        ("hall_eleven.part:Nodd", 'the module "hall_eleven.part" defines no class "Nodd"'),
        ("skills.grasp:Grasp", '"skills.grasp:Grasp" is not a behaviour of py_trees'),
        (
            "hall_eleven.part:Unfinished",
            'the behaviour "Unfinished" (hall_eleven.part:Unfinished) is abstract',
        ),
    ],
)
def test_a_mission_may_name_nothing_else(project: Write, path: str, problem: str) -> None:
    file = project("hall_eleven", NOD, skills='Nod = "hall_eleven.part:Nod"')
    (file.parent / "hall_eleven" / "other.py").write_text("raise SystemExit('a mission executed code')")
    with pytest.raises(InputError) as caught:
        load_behaviour(path)
    assert problem in str(caught.value)
