"""A sort survives a detector that overlooks, confuses, invents and is beside the mark, look by look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from executive.mission.load import LoadedMission, load_mission
from executive.record.result import ledger_agrees
from executive.runtime.cells import cell_kind
from executive.runtime.run import Run
from executive.skill import discover
from executive.testing.fake_cell import FakeCell
from executive.testing.noisy_detector import NoisyDetector
from executive.vision.detectors.setting import Setting

MISSIONS = Path(__file__).parents[2] / "missions"
LONGEST = 200.0
"""Robot time within which six objects are sorted however the detector errs [s]."""


def loaded(tmp_path: Path, mission: str) -> LoadedMission:
    """Return a shipped mission on the shipped cell whose detector errs."""
    text = (MISSIONS / f"{mission}.yaml").read_text().replace("cells/overhead.yaml", "cells/noisy.yaml")
    path = tmp_path / f"{mission}.yaml"
    path.write_text(text)
    return load_mission(path, discover(), kinds=cell_kind)


class Spoilt(FakeCell):
    """The fake cell, its first detector spoiling the answers of the second as the cell file says."""

    def __init__(self, config: Any, *, seed: int, **given: Any) -> None:
        super().__init__(config, seed=seed, **given)
        name, other = config.detectors
        camera = next(iter(config.cameras.values()))
        setting = Setting(name, camera, self.cell.clock, Path(), seed, lambda _: self.detectors[other])
        spoilt: Any = NoisyDetector.from_config(config.detectors[name], setting)
        self.detectors[name] = spoilt

    def advance(self) -> None:
        """Let one control step pass, but not for ever."""
        super().advance()
        assert self.cell.clock.now < LONGEST, "it never comes to an end"


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("mission", ["sort_overhead"])
def test_everything_is_in_its_bin_and_the_books_are_right(tmp_path: Path, mission: str, seed: int) -> None:
    run = Run(loaded(tmp_path, mission), discover(), seed=seed, kind=Spoilt)
    try:
        outcome, items, audit = run.execute(), run.items(), dict(run.audit() or {})
    finally:
        run.close()
    assert (outcome.status, outcome.message) == ("SUCCESS", "")
    assert items["placed"] == audit["right"] == items["seen"] >= 3
    assert ledger_agrees({"items": items, "audit": audit})
