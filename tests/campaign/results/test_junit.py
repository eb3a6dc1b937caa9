"""The report of a sweep in the JUnit XML format."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

from executive.campaign.results.junit import format_junit
from executive.campaign.results.rows import RunRow
from executive.record.result import Audit

SCHEMA: Mapping[str, tuple[set[str], set[str], list[str]]] = {
    "testsuites": (set(), set(), ["testsuite"]),
    "testsuite": ({"name", "tests"}, {"failures", "errors", "time"}, ["testcase"]),
    "testcase": ({"name", "classname"}, {"time"}, ["error", "failure", "system-out"]),
    "error": (set(), {"type", "message"}, []),
    "failure": (set(), {"type", "message"}, []),
    "system-out": (set(), set(), []),
}
"""The used part of junit-10.xsd of Jenkins: required and optional attributes, and children in their order."""


def assert_valid(element: ElementTree.Element) -> None:
    required, optional, children = SCHEMA[element.tag]
    assert required <= set(element.keys()) <= required | optional
    tags = [child.tag for child in element]
    assert tags == sorted(tags, key=children.index), "the children are in the order of the schema"
    for child in element:
        assert_valid(child)


def run(seed: int, status: str = "SUCCESS", reason: str = "", message: str = "", **more: object) -> RunRow:
    return RunRow(
        run_index=seed, seed=seed, status=status, reason=reason, message=message,
        node="tree/Grasp" if reason else "", wall_time_s=2.5, run_directory=f"runs/{seed}", **more,
    )  # fmt: skip


def test_a_run_is_a_test_case() -> None:
    runs = [
        run(0),
        run(1, "FAILURE", "Grasp.missed", "no <seal> \x1b on “cube-1”"),
        run(2, "FAULT", "fault", "it broke"),
        run(3, audit=Audit(agrees=False, wrong_bin=1), variant={"speed": "1"}),
    ]
    text = format_junit("sort", runs, lambda run: f"executive run sort --seed {run.seed}")
    root = ElementTree.fromstring(text.encode())
    assert_valid(root)
    (suite,) = root
    assert {name: suite.get(name) for name in ("tests", "failures", "errors", "time")} == {
        "tests": "4", "failures": "2", "errors": "1", "time": "10.000",
    }  # fmt: skip
    assert {case.get("classname") for case in suite} == {"sort"}
    assert [case.get("name") for case in suite] == ["seed 0", "seed 1", "seed 2", "seed 3 speed=1"]
    assert [case.findtext("system-out") for case in suite] == [
        f"executive run sort --seed {seed}" for seed in range(4)
    ]
    problems = [case[0] for case in suite if len(case) > 1]
    assert [(one.tag, one.get("type")) for one in problems] == [
        ("failure", "Grasp.missed"), ("error", "fault"), ("failure", "disagreement"),
    ]  # fmt: skip
    assert problems[0].text == "FAILURE Grasp.missed tree/Grasp\nno <seal> � on “cube-1”\nruns/1"
    assert str(problems[2].get("message")).startswith("THE AUDIT DISAGREES: 1 in a wrong bin")
