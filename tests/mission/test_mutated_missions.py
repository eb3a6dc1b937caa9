"""Thousands of mutated mission files: each is refused with findings, or runs without a fault.

Nothing that passes the check may fail at run time for its wiring or its types. The runs are on a fake
cell that is a little unkind, so that the ways of failure are taken, too.
"""

from __future__ import annotations

import multiprocessing
import random
import shutil
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import pytest
import yaml
from draft import places
from mutator import Base, Mutant, Mutator
from unkind_cell import UnkindCell
from witness import Witness

from executive.control.scope import Scope
from executive.discovery import discover
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError
from executive.mission.load import LoadedMission, load_mission
from executive.mission.model.grammar import CONTROL
from executive.runtime import run as run_module
from executive.runtime.cells import cell_kind
from executive.runtime.run import Run
from executive.skill import Skill
from executive.testing.fake_cell import FakeCell

HERE = Path(__file__).parent
MISSIONS = HERE.parents[1] / "missions"
OWN_BASES = sorted((HERE / "bases").glob("*.yaml"))

REAL_KINDS = 20
"""Of so many mutants, one asks the kind of cell that its cell file names instead of the fake one."""


@dataclass
class Figures:
    """What became of mutants; `problems` are those that must not be."""

    total: int = 0
    loaded: int = 0
    codes: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: list[tuple[int, str]] = field(default_factory=list)
    slowest: tuple[float, int] = (0.0, -1)
    seconds: float = 0.0

    def add(self, other: Figures) -> None:
        """Add what became of other mutants."""
        self.total, self.loaded = self.total + other.total, self.loaded + other.loaded
        self.codes.update(other.codes)
        self.outcomes.update(other.outcomes)
        self.problems += other.problems
        self.slowest = max(self.slowest, other.slowest)
        self.seconds += other.seconds

    def __str__(self) -> str:
        def listed(counts: Counter[str]) -> str:
            return ", ".join(f"{name} {count}" for name, count in counts.most_common())

        lines = [
            f"{self.total} mutants in {self.seconds:.0f} s of processor time: "
            f"{self.loaded} passed the check ({self.loaded / max(1, self.total):.0%}), "
            f"{self.total - self.loaded} were refused",
            f"runs: {listed(self.outcomes)}",
            f"errors by code, once a mutant: {listed(self.codes)}",
            f"slowest: {self.slowest[0]:.1f} s, seed {self.slowest[1]}",
            f"problems: {len(self.problems)}",
        ]
        lines += [f"-- seed {seed}: {problem}" for seed, problem in self.problems]
        # A problem may be that something cannot be printed.
        return "\n".join(lines).encode(errors="backslashreplace").decode()


class Trial:
    """Loads mutants and runs those that load, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.skills = discover()
        self.mutator = Mutator(bases(), self.skills)
        self._folder = folder

    def of(self, seeds: Iterable[int]) -> Figures:
        """Return what becomes of the mutants of these seeds."""
        figures = Figures()
        for seed in seeds:
            began = time.process_time()
            try:
                self._one(seed, figures)
            except Exception:
                figures.problems.append((seed, traceback.format_exc(limit=-2)))
            took = time.process_time() - began
            figures.slowest, figures.seconds = max(figures.slowest, (took, seed)), figures.seconds + took
        return figures

    def _one(self, seed: int, figures: Figures) -> None:
        figures.total += 1
        mutant = self.mutator.mutant(seed)
        try:
            loaded = self._load(mutant, real_kind=seed % REAL_KINDS == 0)
        except MissionError as error:
            problems = _misplaced(error.findings)
            problems += [] if any(f.severity == "error" for f in error.findings) else ["refused for nothing"]
            figures.codes.update({f.code for f in error.findings if f.severity == "error"})
        except InputError:
            figures.codes["unreadable"] += 1
            return
        else:
            figures.loaded += 1
            problems = _misplaced(loaded.warnings)
            outcome, broken = _run(loaded, self.skills, seed)
            figures.outcomes[outcome] += 1
            problems += broken
        figures.problems += [(seed, problem) for problem in problems]

    def _load(self, mutant: Mutant, real_kind: bool) -> LoadedMission:
        shutil.rmtree(self._folder, ignore_errors=True)
        mission, file = self._folder / "mission.yaml", self._folder / mutant.base.file
        file.parent.mkdir(parents=True)
        mission.write_text(mutant.base.mission)
        # As bytes: no ending of a line is translated.
        file.write_bytes(mutant.text.encode())
        kinds = cell_kind if real_kind else lambda name: FakeCell
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


def _run(loaded: LoadedMission, skills: Mapping[str, type[Skill]], seed: int) -> tuple[str, list[str]]:
    """Return how a run of a mission ends, and what must not be."""
    wishes = random.Random(seed).choices([*loaded.routes, "rescan"], k=5)
    witness = Witness(loaded, skills, scope := Scope())
    with mock.patch.object(run_module, "Scope", lambda: scope):
        run = Run(loaded, skills, seed=seed, observers=[witness], requests=wishes, kind=UnkindCell)
    assert isinstance(run.workcell, UnkindCell)
    witness.cell = run.workcell
    outcome = run.execute()
    run.close()
    return outcome.status, witness.problems(run, outcome)


def _figures_of(seeds: Sequence[int], folder: Path) -> Figures:
    return Trial(folder).of(seeds)


@pytest.mark.parametrize("file", OWN_BASES, ids=lambda file: file.stem)
def test_the_bases_of_the_mutants_pass_the_check(file: Path) -> None:
    assert load_mission(file, discover(), kinds=cell_kind).mission.name == file.stem


def test_the_bases_of_the_mutants_use_every_control_node() -> None:
    files = [yaml.safe_load(file.read_text()) for file in OWN_BASES]
    words = {str(word) for container, key in places(files) for word in (key, container[key])}
    assert set(CONTROL) - words == set()


def test_five_hundred_mutants_are_refused_or_run_without_a_fault(tmp_path: Path) -> None:
    figures = Trial(tmp_path / "trial").of(range(500))
    sys.stdout.write(f"\n{figures}\n")
    assert figures.problems == [], str(figures)
    # Were there hardly any that pass the check, little would be tested.
    assert 0.2 <= figures.loaded / figures.total <= 0.4


@pytest.mark.campaign
def test_twenty_thousand_mutants_are_refused_or_run_without_a_fault(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if "campaign" not in request.config.getoption("-m"):
        pytest.skip("it takes a quarter of an hour: ask for it with -m campaign")
    figures = Figures()
    parts = [range(start, start + 250) for start in range(1000, 21_000, 250)]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        for part in pool.map(_figures_of, parts, [tmp_path / str(part.start) for part in parts]):
            figures.add(part)
    sys.stdout.write(f"\n{figures}\n")
    assert figures.problems == [], f"{len(figures.problems)} mutants did what none may do"
