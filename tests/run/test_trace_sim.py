"""The simulated world repeats itself: one mission and seed, one trace."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.recorder import Trace
from executive.run.assembly import RunOptions, assemble
from executive.testing.oracle import make_oracle_kind


def trace_of(missions: Path, seed: int) -> str:
    trace = Trace()
    loaded = load_mission(missions / "sort_wrist.yaml", load_skills())
    run = assemble(loaded, RunOptions(seed, make_cell=make_oracle_kind()), [trace])
    try:
        assert run.execute().status == "SUCCESS"
    finally:
        run.close()
    return trace.hexdigest()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_trace_and_another_one_does_not(missions: Path) -> None:
    first, other, again = (trace_of(missions, seed) for seed in (7, 8, 7))
    assert first == again != other
