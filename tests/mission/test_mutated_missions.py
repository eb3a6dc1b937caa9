"""Mutated mission files: each is refused with findings, or runs without a fault.

Nothing that passes the check may fail at run time for its wiring or its types. The runs are on a fake
cell that is a little unkind, so that the ways of failure are taken, too.
"""

from __future__ import annotations

import random
import shutil
import traceback
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import pytest
import yaml

from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError
from executive.mission.load import LoadedMission, load_mission
from executive.mission.model.grammar import USE_KEYWORD
from executive.plugins import load_cell_kind, load_skills
from executive.run import assembly
from executive.run.assembly import RunOptions, assemble
from executive.skill import Skill
from executive.tree.blackboard import Blackboard
from executive.tree.node_registry import load_control_nodes
from tests.mission.mutations import places
from tests.mission.mutator import Base, Mutator
from tests.mission.unkind_cell import UnkindCell
from tests.mission.witness import Witness

pytestmark = pytest.mark.usefixtures("shared_cells")

HERE = Path(__file__).parent
MISSIONS = HERE.parents[1] / "missions"
OWN_BASES = sorted((HERE / "bases").glob("*.yaml"))

REAL_KINDS = 20
"""Of so many mutants, one asks the kind of cell that its cell file names instead of the fake one."""


@dataclass
class Trial:
    """Loads mutants in a folder of its own and runs those that load.

    Attributes:
        loaded: Number of mutants that passed the check.
        problems: What must not be, each with the seed of its mutant.
    """

    folder: Path
    loaded: int = 0
    problems: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.skills = load_skills()
        self.mutator = Mutator(bases())

    def try_mutant(self, seed: int) -> None:
        """Load the mutant of a seed, and run it if it loads."""
        try:
            problems = self._problems(seed)
        except Exception:
            problems = [traceback.format_exc(limit=-2)]
        # A problem may be that something cannot be printed.
        lines = [f"seed {seed}: {problem}" for problem in problems]
        self.problems += [line.encode(errors="backslashreplace").decode() for line in lines]

    def _problems(self, seed: int) -> list[str]:
        try:
            loaded = self._load(*self.mutator.mutant(seed), real_kind=seed % REAL_KINDS == 0)
        except MissionError as error:
            refused = any(finding.severity == "error" for finding in error.findings)
            return _misplaced(error.findings) + ([] if refused else ["refused for nothing"])
        except InputError:
            return []
        self.loaded += 1
        return _misplaced(loaded.warnings) + _run(loaded, self.skills, seed)

    def _load(self, base: Base, text: str, real_kind: bool) -> LoadedMission:
        shutil.rmtree(self.folder, ignore_errors=True)
        mission, file = self.folder / "mission.yaml", self.folder / base.file
        file.parent.mkdir(parents=True)
        mission.write_text(base.mission)
        # As bytes: no ending of a line is translated.
        file.write_bytes(text.encode())
        kinds = load_cell_kind if real_kind else lambda name: FakeCell
        return load_mission(mission, self.skills, {"cell.table.objects": "[1, 3]"}, kinds)


def bases() -> list[Base]:
    """Return every shipped mission, those beside this test that use what else there is, and a library."""
    files = [*sorted(MISSIONS.glob("*.yaml")), *OWN_BASES]
    texts = {file.stem: file.read_text() for file in files}
    library = (MISSIONS / "library" / "sorting.yaml").read_text()
    return [
        *(Base(name, "mission.yaml", text, text) for name, text in texts.items()),
        Base("library", "library/sorting.yaml", library, texts["ask_and_fetch"]),
    ]


def _misplaced(findings: Iterable[Finding]) -> list[str]:
    """Return what is wrong with the places and the texts of findings."""
    problems = []
    for finding in findings:
        # Encoded as on its way to the terminal.
        if finding.message.encode() not in str(finding).encode():
            problems.append(f"{finding!r} is not rendered")
        if finding.path.startswith("--set") or finding.line == 0:
            continue
        lines = Path(finding.path).read_bytes().decode("utf-8-sig").splitlines() or [""]
        if finding.line > len(lines) or not 1 <= finding.col <= len(lines[finding.line - 1]) + 1:
            problems.append(f"{finding} is not in the file")
    return problems


def _run(loaded: LoadedMission, skills: Mapping[str, type[Skill]], seed: int) -> list[str]:
    """Return what must not be in a run of a mission."""
    wishes = random.Random(seed).choices([*loaded.routes, "rescan"], k=5)
    witness = Witness(loaded, skills, scope := Blackboard())
    with mock.patch.object(assembly, "Blackboard", lambda: scope):
        options = RunOptions(seed, wishes, make_cell=UnkindCell)
        run = assemble(loaded, options, [witness])
    assert isinstance(run.workcell, UnkindCell)
    witness.cell = run.workcell
    outcome = run.execute()
    run.close()
    return witness.problems(run, outcome)


@pytest.mark.parametrize("file", OWN_BASES, ids=lambda file: file.stem)
def test_the_bases_of_the_mutants_pass_the_check(file: Path) -> None:
    assert load_mission(file, load_skills(), find_cell_kind=load_cell_kind).mission.name == file.stem


def test_the_bases_of_the_mutants_use_every_control_node() -> None:
    files = [yaml.safe_load(file.read_text()) for file in OWN_BASES]
    words = {str(word) for container, key in places(files) for word in (key, container[key])}
    assert {*load_control_nodes(), USE_KEYWORD} - words == set()


@pytest.mark.parametrize(
    "seeds",
    [
        pytest.param(range(40), marks=pytest.mark.slow),
        pytest.param(range(40, 600), marks=pytest.mark.slow),
        pytest.param(range(1000, 21_000), marks=pytest.mark.campaign),
    ],
    ids=len,
)
def test_mutants_are_refused_or_run_without_a_fault(tmp_path: Path, seeds: range) -> None:
    trial = Trial(tmp_path / "trial")
    for seed in seeds:
        trial.try_mutant(seed)
    assert trial.problems == [], "\n".join(trial.problems)
    # Were there hardly any that pass the check, little would be tested.
    assert 0.2 <= trial.loaded / len(seeds) <= 0.4
