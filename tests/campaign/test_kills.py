"""Missions killed at random moments and taken up again."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.campaign.kills import kill_often
from executive.campaign.subject import Subject
from executive.discovery import discover
from executive.mission.load import load_mission
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import oracle_cell
from executive.view.figures.kill import Kill, KillFigures, as_plain, kill_text


def subject(missions: Path, name: str, kind, cell: str) -> Subject:
    skills = discover()
    return Subject(load_mission(missions / f"{name}.yaml", skills), skills, kind, cell, seed=7)


@pytest.mark.parametrize(
    ("name", "kind", "kills"), [("sort_overhead", FakeCell, 4), ("sort_wrist", oracle_cell(), 2)]
)
def test_whenever_it_is_killed_it_ends_as_the_world_allows(
    missions: Path, tmp_path: Path, name: str, kind, kills: int
) -> None:
    figures = kill_often(
        subject(missions, name, kind, "a cell"), kills=kills, changed=kills // 2, runs=tmp_path
    )
    assert (figures.complete, list(figures.failed)) == (True, []), kill_text(figures)
    assert {kill.status for kill in figures.kills} <= {"SUCCESS", "FAILURE lost"}
    # What nothing is wrong about is not kept.
    assert not list(tmp_path.glob("[0-9]*"))
    assert len(as_plain(figures)["kills"]) == kills


def test_what_went_wrong_is_told_with_what_repeats_it() -> None:
    good = Kill(0, 7, 1.0, 2.5, ("Grasp",), status="SUCCESS")
    bad = Kill(
        1, 8, 1.5, 3.25, ("Transit", "Wait"), "the cube fell from the tool", "FAILURE lost",
        ("cube-1 was placed 2 times", "the tool holds cube-2 at its end"), "runs/1/x",
    )  # fmt: skip
    assert kill_text(KillFigures("sort", "simulated", 3, [good, bad])) == (
        "sort (simulated): killed 2 times, the world changed in 1\n"
        "  ended by the user; 3 kills were to be tried\n"
        "  under way: Grasp 1, Transit 1, Wait 1\n"
        "  ended, taken up again: SUCCESS 1, FAILURE lost 1\n"
        "  not as it has to be: 1\n"
        "  kill 1, seed 8, at 3.25 s; the cube fell from the tool: runs/1/x\n"
        "    cube-1 was placed 2 times\n"
        "    the tool holds cube-2 at its end"
    )
