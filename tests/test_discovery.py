"""Skills that packages register, and what is said of those that cannot be loaded."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.plugins import load_skills

Install = Callable[..., None]

HEAD = "from executive.skill import Out, Skill, param\n\n\n"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Make a module the only one that registers skills, under these names."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)

    def install(module: str, text: str, **entries: str) -> None:
        (tmp_path / f"{module}.py").write_text(text)
        points = [
            EntryPoint(name, f"{module}:{value}", "executive.skills") for name, value in entries.items()
        ]
        monkeypatch.setattr("executive.plugins.entry_points", lambda group: points)

    return install


def test_it_is_found_by_its_name(install: Install) -> None:
    install("wave_one", HEAD + 'class Wave(Skill):\n    """Wave."""\n', Wave="Wave")
    assert [(name, skill.__doc__) for name, skill in load_skills().items()] == [("Wave", "Wave.")]


@pytest.mark.parametrize(
    ("module", "text", "says"),
    [
        ("wave_two", "import nowhere\n", r"ModuleNotFoundError: No module named 'nowhere', in .*two.py:1;"),
        ("wave_three", "class Wave(\n", r"SyntaxError: '\(' was never closed \(wave_three.py, line 1\);"),
        ("wave_four", HEAD + "Weave = Skill\n", "module 'wave_four' has no attribute 'Wave';"),
        ("wave_five", HEAD + "class Wave(Skill):\n    high: float = param(1, min=0)\n", r"'min', in .*:5;"),
        ("wave_six", HEAD + "class Wave(Skill):\n    seen: Out[Foo]\n", r"'Foo' is not defined, in .*:5;"),
    ],
)
def test_one_that_cannot_be_loaded_is_named_with_the_place(
    install: Install, module: str, text: str, says: str
) -> None:
    install(module, text, Wave="Wave")
    with pytest.raises(InputError) as caught:
        load_skills()
    assert str(caught.value).startswith(f'the skill "Wave" ({module}:Wave) cannot be loaded: ')
    assert str(caught.value).endswith(f"; correct it, or uninstall the package {module}")
    caught.match(says)


def test_what_is_no_skill_is_refused(install: Install) -> None:
    install("wave_seven", "Wave = 3\n", Wave="Wave")
    with pytest.raises(
        InputError, match=r'the entry point "Wave" \(wave_seven:Wave\) is neither a subclass of Skill nor'
    ):
        load_skills()
