"""What is printed of the bench of motion."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from executive.view.figures.motion import (
    ExecutionFigures,
    MethodFigures,
    MotionFigures,
    PlanningFigures,
    as_plain,
    print_figures,
)

MEASURED = MotionFigures(
    cell="overhead", pairs=199, seed=3, margin=0.005,
    article=MethodFigures("article", 6.5, (8.391, 272.7, 7199.5)),
    article_cycle=7.25,
    stopping=MethodFigures("stops at vias", 3.0, (1.0, 1.0, 1.0), (1.25, 3.5)),
    toppra=MethodFigures("TOPP-RA", 2.0, (1.0, 1.17, 30.6), (8.0, 17.0)),
    floor=MethodFigures("floor", 1.5, (1.0, 1.0, 1.0)),
    free_floor=1.44,
    ours=MethodFigures("ours", 1.8, (1.0, 0.99, 1.0), (31.4, 88.8), 0.00512),
    nearest="the tool - a cube",
    planning=PlanningFigures(400, 31.4, 88.8, 0.975, 1.0, ("too near to a wall",)),
)  # fmt: skip
EXECUTED = ExecutionFigures(
    pairs=100, clearance=0.0061, nearest="link 5 - red_bin", contacts=("link 5 - red_bin",), slip=0.00024,
    missed=1, drops=2, tracking=1e-6, time=1.912, failures=("too far", "too far"),
)  # fmt: skip

NOTHING_BROUGHT = ExecutionFigures(
    pairs=100, clearance=None, nearest="nothing", contacts=(), slip=0.0, missed=100, drops=0, tracking=1e-6,
    time=None, failures=(),
)  # fmt: skip


@pytest.fixture
def printed(capsys):
    """A function that prints figures and returns the lines, their inner space collapsed."""

    def lines(figures):
        print_figures(figures)
        captured = capsys.readouterr()
        assert captured.err == ""
        return [" ".join(line.split()) for line in captured.out.splitlines()]

    return lines


def test_a_table_of_all_methods_slowest_kind_first(printed):
    lines = printed(MEASURED)
    assert lines[0].startswith("overhead: 199 random pairs, seed 3; motion from bin to object to bin")
    assert [
        line for line in lines if line.split(" ")[0] in ("article", "stops", "TOPP-RA", "ours", "floor")
    ] == [
        "article 6.500 1.00 4.33 8.39 273 7200",
        "stops at vias 3.000 0.46 2.00 1.00 1.00 1.00 1.2 3.5",
        "TOPP-RA 2.000 0.31 1.33 1.00 1.17 31 8.0 17.0",
        "ours 1.800 0.28 1.20 1.00 0.99 1.00 31.4 88.8 5.1",
        "floor 1.500 0.23 1.00 1.00 1.00 1.00",
    ]
    assert "ours: 0.90 of TOPP-RA's time, 1.25 of the floor's with the first posture free (1.44 s)" in lines
    assert "planning 400 motions: 97.5% within 50 ms, 100.0% within 150 ms, median 31 ms, p99 89 ms" in lines
    assert "not planned, 1 times: too near to a wall" in lines
    assert not any("executed" in line for line in lines)


def test_the_table_fits_a_terminal_of_80_columns(capsys):
    print_figures(MEASURED)
    rows = [
        line for line in capsys.readouterr().out.splitlines() if line.strip().startswith(("s ", "article"))
    ]
    assert all(len(row) <= 80 for row in rows)


def test_what_was_executed_is_told_where_it_was(printed):
    lines = printed(replace(MEASURED, execution=EXECUTED))
    assert lines[-6:] == [
        "executed 100 pairs in the live world: 1.912 s of motion each",
        "least clearance 6.1 mm (link 5 - red_bin), margin 5 mm",
        "worst slip in the hand 0.24 mm; 1 grasps missed, 2 objects dropped",
        "worst tracking error 0.00006°; contacts that are not allowed: 1",
        "contact, 1 times: link 5 - red_bin",
        "failed, 2 times: too far",
    ]


def test_a_dash_stands_where_no_pair_could_be_measured(printed):
    lines = printed(replace(MEASURED, execution=NOTHING_BROUGHT))
    assert lines[-4:-2] == [
        "executed 100 pairs in the live world: - s of motion each",
        "least clearance - mm (nothing), margin 5 mm",
    ]


def test_what_could_not_be_measured_is_none_as_plain_value():
    plain = as_plain(replace(MEASURED, execution=NOTHING_BROUGHT))
    execution = json.loads(json.dumps(plain, allow_nan=False))["execution"]
    assert (execution["missed"], execution["time_s"], execution["clearance_mm"]) == (100, None, None)


def test_as_plain_values_they_are_one_json_object():
    plain = json.loads(json.dumps(as_plain(replace(MEASURED, execution=EXECUTED))))
    assert plain["methods"][3] == {
        "name": "ours", "time_s": 1.8, "over_article": 0.2769, "over_floor": 1.2, "peak_velocity": 1.0,
        "peak_acceleration": 0.99, "peak_jerk": 1.0, "planning_median_ms": 31.4, "planning_p99_ms": 88.8,
        "clearance_mm": 5.12,
    }  # fmt: skip
    assert plain["ours_over"] == {
        "article": 0.2769, "article_cycle": 0.2483, "stops_at_vias": 0.6, "toppra": 0.9, "floor": 1.2,
        "free_floor": 1.25,
    }  # fmt: skip
    assert plain["planning"]["within_50_ms"] == 0.975
    assert plain["execution"]["slip_mm"] == 0.24
    assert as_plain(MEASURED)["execution"] is None
