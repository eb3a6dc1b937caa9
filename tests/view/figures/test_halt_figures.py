"""What is told of halts."""

from __future__ import annotations

from executive.view.figures.halt import Halt, HaltFigures, as_plain, halt_text

LOST = "the ledger says seen 1; the audit left 0"
HALTS = (
    Halt(0, 0.0),
    Halt(10, 0.0417, True, 0.3, 2e-8, 0.9, 0.95, "cube_1", True),
    Halt(20, 0.0833, True, 0.25, 3e-8, 0.8, 1.01, problems=(LOST,)),
    Halt(30, 0.125, True, 0.6, problems=("it took 0.6 s to rest; 0.5 is allowed", LOST)),
)
FIGURES = HaltFigures("sort", "sim", 3, 40, HALTS, 4)


def test_the_worst_of_everything_is_told_with_its_tick() -> None:
    lines = halt_text(FIGURES).splitlines()
    assert lines[:6] == [
        "sort (sim), seed 3: halted at 4 moments of a run of 40 ticks",
        "  the arm was on the move at 3 of them, something was in the tool at 1; "
        "the mission was run again after 1",
        "  longest time to rest 0.600 s (0.5), at tick 30",
        "  farthest from the path 3.0e-08 rad (1e-06), at tick 20",
        "  largest acceleration 0.900 of its stop limit (1), at tick 10",
        "  largest jerk 1.010 of its stop limit (1.02), at tick 20",
    ]


def test_a_problem_is_told_once_with_how_often_it_was_met() -> None:
    assert halt_text(FIGURES).splitlines()[6:] == [
        "  not as it has to be: 2",
        f"    tick 20 (0.08 s): {LOST}",
        "      and at 1 more, up to tick 30",
        "    tick 30 (0.12 s): it took 0.6 s to rest; 0.5 is allowed",
    ]


def test_without_a_simulated_arm_nothing_is_said_of_its_path() -> None:
    text = halt_text(HaltFigures("sort", "fake", 0, 40, HALTS[:1], 1))
    assert "path" not in text
    assert text.endswith("not as it has to be: none")


def test_a_campaign_that_was_cut_short_says_so() -> None:
    cut = HaltFigures("sort", "fake", 0, 40, HALTS[:2], 4)
    assert not cut.complete
    assert "ended by the user; 4 moments were to be tried" in halt_text(cut)


def test_no_halt_at_all_is_told_too() -> None:
    none = HaltFigures("sort", "fake", 0, 40, (), 4)
    assert "halted at 0 moments" in halt_text(none)
    assert as_plain(none)["worst"]["rest_s"] is None


def test_as_plain_values() -> None:
    plain = as_plain(FIGURES)
    assert plain["worst"] == {
        "rest_s": {"value": 0.6, "tick": 30},
        "deviation_rad": {"value": 3e-8, "tick": 20},
        "acceleration_share": {"value": 0.9, "tick": 10},
        "jerk_share": {"value": 1.01, "tick": 20},
    }
    assert (plain["points"], plain["moving"], plain["holding"], plain["followed"]) == (4, 3, 1, 1)
    assert plain["failed"][0] == {"tick": 20, "clock_s": 0.0833, "problems": [LOST]}
