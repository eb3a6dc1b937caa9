"""What the guides show works as it is written there."""

from __future__ import annotations

import importlib.util
import re
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest
from at_terminal import invoke
from guide_blocks import GUIDES, ROOT, TUTORIAL, blocks, files, read, shown, transcripts
from jsonschema import Draft7Validator

from executive.behaviours import load_skills
from executive.drivers.sim.scene import load_scene
from executive.events import Event
from executive.mission.cell_file import load_cell
from executive.mission.load import LoadedMission, load_mission
from executive.mission.schema import make_mission_schema
from executive.run.assembly import RunOptions, assemble
from executive.station.check import load_checker
from executive.testing.fake_cell import FakeCell
from executive.text.files import list_shipped_missions
from executive.text.findings import Source
from executive.text.yaml_files import parse_yaml
from executive.tree.node import load_control_nodes

LONGEST = 300.0
"""Time on the run's clock within which every mission shown is done on the fake cell [s]."""

FILES = files()
MISSIONS = [name for name, file in FILES.items() if "/" not in name and not file.block.is_mistake]
SCENES = [name for name in FILES if name.startswith("scenes/")]
TRANSCRIPTS = [pytest.param(words, printed, id=where) for where, words, printed in transcripts()]
PYTHON = [pytest.param(block.text, id=block.where) for block in shown("python")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with every file that the guides to missions show."""
    monkeypatch.chdir(tmp_path)
    for name, file in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text, encoding="utf-8")
    return tmp_path


def in_time(event: Event) -> None:
    """Observe a run that must come to an end."""
    assert event.clock < LONGEST, "it does not come to an end"


def assert_does_its_work(loaded: LoadedMission) -> None:
    # A detector behind a server cannot be measured here.
    assert [one for one in loaded.warnings if one.code != "not-measured"] == []
    options = RunOptions(0, [*loaded.routes], make_cell=FakeCell)
    run = assemble(loaded, options, [in_time])
    try:
        outcome = run.execute()
        assert (outcome.status, outcome.message) == ("SUCCESS", "")
        items = run.station.ledger.count_states()
        assert items["lost"] == 0
        # Whoever says where things go brings at least one of them there.
        assert items["placed"] >= bool(loaded.routes)
    finally:
        run.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", MISSIONS)
def test_every_mission_of_the_mission_guides_does_its_work(name: str, folder: Path) -> None:
    assert_does_its_work(load_mission(name, load_skills(), find_checker=load_checker))


def test_the_mission_on_the_front_page_does_its_work(tmp_path: Path) -> None:
    (block,) = (block for block in blocks("README.md") if block.language == "yaml")
    path = tmp_path / "shown.yaml"
    path.write_text(block.text, encoding="utf-8")
    assert_does_its_work(load_mission(path, load_skills(), find_checker=load_checker))


def test_an_editor_marks_nothing_in_the_missions_of_the_mission_guides() -> None:
    validator = Draft7Validator(make_mission_schema(load_skills(), load_control_nodes()))
    for name in MISSIONS:
        root, _ = parse_yaml(Source(name, FILES[name].text))
        assert root is not None
        assert [error.message for error in validator.iter_errors(root.python_value)] == [], name


@pytest.mark.parametrize(("words", "printed"), TRANSCRIPTS)
def test_every_command_of_the_mission_guides_prints_what_is_shown(
    words: list[str], printed: str, folder: Path
) -> None:
    assert lasting(invoke(*words).output) == lasting(printed)


def lasting(printed: str) -> str:
    """Return what is printed without what differs between runs, and without the list of installed skills."""
    printed = re.sub(r"(Installed skills: \w+), .*", r"\1, ...", printed)
    printed = re.sub(r"[\d.]+ s by the wall clock", "... by the wall clock", printed)
    return re.sub(r"runs/\S+", "runs/...", printed).rstrip()


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_of_the_mission_guides_fits_the_cell_of_its_missions(name: str, folder: Path) -> None:
    scene = load_scene(Path(name), load_cell(ROOT / "missions" / "cells" / "overhead.yaml"))
    assert f"scenes/{scene.scene}.yaml" == name


@pytest.mark.parametrize("script", ["mission_reference.py", "skill_reference.py"])
def test_each_reference_is_that_of_the_code(script: str) -> None:
    generator = runpy.run_path(str(ROOT / ".ci" / script))
    written = generator["PATH"].read_text(encoding="utf-8")
    assert written == generator["generate"](), f"write it again: {generator['COMMAND']}"


def test_the_counts_that_guides_state_are_those_of_the_repository() -> None:
    counts = {"missions": len(list_shipped_missions()), "skills": len(load_skills())}
    stated = re.findall(r"(\d+) (missions|skills)\b", "".join(map(read, GUIDES)))
    assert {(int(count), noun) for count, noun in stated} == {(counts[noun], noun) for noun in counts}


@pytest.mark.parametrize(("guide", "limit"), [("README.md", 8_000), (TUTORIAL, 20_000)])
def test_front_page_and_tutorial_stay_short(guide: str, limit: int) -> None:
    assert len(read(guide).encode()) <= limit


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


@pytest.mark.parametrize("text", PYTHON)
def test_every_piece_of_python_shown_runs_with_its_tests(text: str, tmp_path: Path) -> None:
    module = module_of(text, tmp_path / "shown.py")
    for name, member in list(vars(module).items()):
        if name.startswith("test_"):
            member()


def test_every_file_and_folder_that_a_guide_links_to_exists() -> None:
    for guide in (*GUIDES, "skills/reference.md", "executive/README.md", "CONTRIBUTING.md"):
        folder = (ROOT / guide).parent
        links = re.findall(r"\]\(([^)#]+)[)#]", read(guide))
        missing = [link for link in links if "://" not in link and not (folder / link).exists()]
        assert not [link for link in missing if not link.endswith(".png")], guide


def test_every_heading_that_a_guide_links_to_exists() -> None:
    for guide in (*GUIDES, "missions/reference.md", "executive/README.md", "CONTRIBUTING.md"):
        for path, anchor in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", read(guide)):
            target = (ROOT / guide).parent / path if path else ROOT / guide
            headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
            assert anchor in anchors, f"{guide}: {path}#{anchor}"


@pytest.mark.parametrize("guide", ["executive/README.md", "CONTRIBUTING.md"])
def test_every_file_that_a_guide_to_the_code_names_exists(guide: str) -> None:
    named = set(re.findall(r"`((?:\w+/)+(?:[\w.]+)?)`", read(guide)))
    roots = (ROOT, ROOT / "executive")
    assert named
    assert not {name for name in named if not any((root / name).exists() for root in roots)}
