"""Requirements on the results of a sweep."""

from __future__ import annotations

import pytest

from executive.campaign.results.requirement import describe_unmet_conditions, parse_requirement
from executive.campaign.results.rows import RunRow
from executive.campaign.results.sweep_summary import summarize_runs
from executive.errors import InputError
from executive.record.result import Audit, ItemCounts


def run(seed: int, variant: str = "", **values: object) -> RunRow:
    end = {"status": "SUCCESS", "reason": "", "message": "", "node": "", "robot_time_s": float(seed)}
    settings = {"run_index": seed, "seed": seed, "variant": {"v": variant} if variant else {}}
    return RunRow(**settings | end | {"items": ItemCounts(placed=2)} | values)


def find_unmet(text: str, *runs: RunRow) -> list[str]:
    return describe_unmet_conditions(parse_requirement(text), runs, summarize_runs(runs, [], lambda run: ""))


@pytest.mark.parametrize(
    ("text", "unmet"),
    [
        ("success>=1 and robot_time_s", None),
        ("success >= 1.0 and p95(robot_time_s)<10", []),
        (
            "median(robot_time_s)<5 and max(robot_time_s)<=9",
            ["median(robot_time_s)<5 is not met: the value is 5"],
        ),
        ("mean(robot_time_s)>5", ["mean(robot_time_s)>5 is not met: the value is 5"]),
        (
            "p99( robot_time_s )>8.9 and min(robot_time_s)>1",
            ["min(robot_time_s)>1 is not met: the value is 1"],
        ),
        ("objects_per_hour>1e4", ["objects_per_hour>10000 is not met: the value is 1440"]),
        ("agreement>0.5", ["agreement>0.5 is not met: no run has a value"]),
        ("max(audit_wrong_bin)<1", ["max(audit_wrong_bin)<1 is not met: no run has a value"]),
    ],
)
def test_each_comparison_is_met_or_explained(text: str, unmet: list[str] | None) -> None:
    if unmet is None:
        with pytest.raises(InputError, match="is no comparison"):
            parse_requirement(text)
    else:
        assert find_unmet(text, *(run(seed) for seed in range(1, 10))) == unmet


def test_every_variant_must_meet_the_requirement() -> None:
    runs = (run(1, "a"), run(2, "b", status="FAILURE", audit=Audit(agrees=False)))
    assert find_unmet("success>0.5", *runs) == ["success>0.5 is not met with v=b: the value is 0"]
    assert find_unmet("success>0.5") == ["no run has ended"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "",
            r'"" is no comparison of a metric with a number; write for example success>=0.99 and p95\(',
        ),
        ("success=1", '"success=1" is no comparison'),
        ("success>1 or success<2", '"success>1 or success<2" is no comparison'),
        ("success>1 and", '"" is no comparison'),
        ("success>one", '"success>one" is no comparison'),
        ("__import__('os')>1", "is no comparison"),
        (
            "speed>1",
            r'there is no metric "speed"; the metrics are success, agreement, objects_per_hour, mean\(',
        ),
        ("p98(ticks)>1", r'there is no metric "p98"; .*, p95\(COLUMN\), p99\(COLUMN\), max\(COLUMN\)$'),
        (
            "p95(trace)>1",
            '"trace" is no numeric column of the runs; these are items_seen, .*, robot_time_s, wall',
        ),
    ],
)
def test_another_text_is_refused_with_the_allowed_names(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_requirement(text)
