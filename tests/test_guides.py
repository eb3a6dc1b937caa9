"""What the guides show works as it is written there."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from executive.messages import Target
from executive.mission.load import load_mission
from executive.runtime.cells import robot_check
from executive.skill import discover
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill

ROOT = Path(__file__).parent.parent
GUIDES = ("README.md", "missions/README.md", "skills/README.md")


def blocks(language: str) -> list[tuple[str, str]]:
    """Return the fenced blocks of a language in all guides, each with where it stands."""
    found = []
    for guide in GUIDES:
        text = (ROOT / guide).read_text(encoding="utf-8")
        for match in re.finditer(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            line = text.count("\n", 0, match.start()) + 1
            found.append((f"{guide}:{line}", match[1]))
    return found


def shown(language: str) -> pytest.MarkDecorator:
    """Parametrize a test with the text of every block of a language."""
    return pytest.mark.parametrize("text", [pytest.param(text, id=where) for where, text in blocks(language)])


def module_of(text: str, path: Path) -> ModuleType:
    """Return a block as a module; one without imports gets those of the shipped Grasp."""
    if "import" not in text:
        grasp = (ROOT / "skills" / "grasp.py").read_text(encoding="utf-8")
        text = grasp.partition("class Grasp")[0] + text
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # The annotations of a class are looked up in the module of its name.
    sys.modules[path.stem] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[path.stem]
    return module


@shown("yaml")
def test_every_mission_shown_can_be_run(text: str, tmp_path: Path) -> None:
    path = tmp_path / "shown.yaml"
    path.write_text(text, encoding="utf-8")
    assert load_mission(path, discover(), robot_check=robot_check).warnings == ()


@shown("python")
def test_every_piece_of_python_shown_runs_with_its_tests(text: str, tmp_path: Path) -> None:
    module = module_of(text, tmp_path / "shown.py")
    for name, member in list(vars(module).items()):
        if name.startswith("test_"):
            member()


def test_the_guides_show_missions_and_skills() -> None:
    assert len(blocks("yaml")) >= 2
    assert len(blocks("python")) >= 3


def test_the_skill_to_copy_works(fake: FakeCell, tmp_path: Path) -> None:
    (text,) = (text for _, text in blocks("python") if "class PointAt" in text)
    skill = module_of(text, tmp_path / "point_at.py").PointAt
    target = Target("cube-1", "cube", np.array([0.5, 0.1, 0.025]), 0.9, 1, 0, 0.0)
    assert run_skill(skill(target=target, height=0.03), fake).status == "SUCCESS"
    assert fake.arm.tool_pose.position == pytest.approx([0.5, 0.1, 0.08])
    far = Target("cube-2", "cube", np.array([0.9, 0.3, 0.025]), 0.9, 1, 0, 0.0)
    assert run_skill(skill(target=far), fake).reason == "unreachable"


def test_the_skill_on_the_front_page_declares_what_the_shipped_one_does(tmp_path: Path) -> None:
    (text,) = (text for _, text in blocks("python") if "class Grasp" in text)
    shown_skill, shipped = module_of(text, tmp_path / "grasp.py").Grasp, discover()["Grasp"]
    assert (shown_skill.params, shown_skill.reasons) == (shipped.params, shipped.reasons)
    assert list(shown_skill.ports) == list(shipped.ports)


def test_every_file_and_folder_that_a_guide_links_to_exists() -> None:
    for guide in (*GUIDES, "executive/README.md", "CONTRIBUTING.md"):
        path = ROOT / guide
        links = re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8"))
        missing = [link for link in links if "://" not in link and not (path.parent / link).exists()]
        assert not [link for link in missing if not link.endswith(".png")], guide
