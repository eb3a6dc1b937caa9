"""Mutated mission files: each is refused with findings, or runs without a fault."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

import pytest

from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.mission.findings import MissionError
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.run.assembly import RunOptions, assemble
from tests.mission.mutator import Base, Mutator

MISSIONS = Path(__file__).parents[2] / "missions"
BASES = sorted((Path(__file__).parent / "bases").glob("*.yaml"))


MAX_STEPS = 4000
"""Number of control steps after which a run is halted."""


class HaltedCell(FakeCell):
    """A fake cell that halts its run as Ctrl-C does."""

    def advance(self) -> None:
        super().advance()
        if self.steps == MAX_STEPS:
            signal.raise_signal(signal.SIGINT)


def make_bases() -> list[Base]:
    """Return the shipped missions, those beside this test that use all control nodes, and a library."""
    texts = {file.stem: file.read_text() for file in [*sorted(MISSIONS.glob("*.yaml")), *BASES]}
    library = (MISSIONS / "library" / "sorting.yaml").read_text()
    missions = [Base(name, "mission.yaml", text, text) for name, text in texts.items()]
    return [*missions, Base("library", "library/sorting.yaml", library, texts["ask_and_fetch"])]


@pytest.mark.slow
@pytest.mark.usefixtures("shared_cells")
def test_mutants_are_refused_or_run_without_a_fault(tmp_path: Path) -> None:
    mutator, skills, run_count = Mutator(make_bases()), load_skills(), 0
    for seed in range(100):
        base, text = mutator.mutant(seed)
        folder = tmp_path / str(seed)
        mission, file = folder / "mission.yaml", folder / base.file
        file.parent.mkdir(parents=True)
        mission.write_text(base.mission)
        file.write_bytes(text.encode())
        try:
            loaded = load_mission(
                mission, skills, {"cell.table.objects": "[1, 3]"}, find_cell_kind=lambda name: FakeCell
            )
        except MissionError as error:
            assert any(finding.severity == "error" for finding in error.findings), seed
            assert str(error).encode(), seed
            continue
        except InputError:
            continue
        requests = [*loaded.routes, "rescan"]
        run = assemble(loaded, RunOptions(seed, requests, make_cell=HaltedCell), [])
        outcome = run.execute()
        run.close()
        assert outcome.status != "FAULT", f"seed {seed}: {outcome.message}"
        run_count += 1
        shutil.rmtree(folder)
    assert run_count >= 20, "few mutants pass the check"
