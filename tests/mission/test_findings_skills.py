# ruff: noqa: E501 - findings are quoted as they are printed
"""Findings about skills, their params and their ports, word for word."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import dedent

import pytest

from executive.mission.findings import MissionError
from executive.mission.load import LoadedMission

CASES = {
    "unknown skill": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Lok
        """,
        """
        m.yaml:4:5: error[unknown-skill]: there is no skill "Lok"
           4 |   - Lok
             |     ^^^
          Did you mean "Look"? Installed skills: Look, Pick, Drop.
        """,
    ),
    "unknown setting": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {veiw: full}
        """,
        """
        m.yaml:4:12: error[unknown-param]: Look has no param or port "veiw"
           4 |   - Look: {veiw: full}
             |            ^^^^
          Did you mean "view"? Look takes: view, detector, pose, classes, seen.
        """,
    ),
    "attempts zero": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {retry: {attempts: 0, do: Look}}
        """,
        """
        m.yaml:3:26: error[out-of-range]: retry.attempts must be at least 1, not 0
           3 | tree: {retry: {attempts: 0, do: Look}}
             |                          ^
        """,
    ),
    "attempts param": (
        """
        mission: m
        cell: cells/small.yaml
        params: {tries: many}
        tree: {retry: {attempts: $tries, do: Look}}
        """,
        """
        m.yaml:3:17: error[wrong-type]: retry.attempts must be a whole number, not the text "many" (it is $tries in line 4)
           3 | params: {tries: many}
             |                 ^^^^
        """,
    ),
    "attempts variable": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {retry: {attempts: $seen, do: Look}}
        """,
        """
        m.yaml:3:26: error[unknown-param]: retry.attempts is a constant, and $seen is neither param nor argument here
           3 | tree: {retry: {attempts: $seen, do: Look}}
             |                          ^^^^^
          The mission's params: none.
        """,
    ),
    "timeout zero": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {timeout: {seconds: 0, do: Look}}
        """,
        """
        m.yaml:3:27: error[out-of-range]: timeout.seconds must be more than 0 s, not 0
           3 | tree: {timeout: {seconds: 0, do: Look}}
             |                           ^
        """,
    ),
    "wrong type": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, {Pick: {height: tall}}]
        """,
        """
        m.yaml:3:30: error[wrong-type]: Pick.height must be a number, not the text "tall"
           3 | tree: [Look, {Pick: {height: tall}}]
             |                              ^^^^
        """,
    ),
    "int for fraction": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, {Pick: {tries: 1.5}}]
        """,
        """
        m.yaml:3:29: error[wrong-type]: Pick.tries must be a whole number, not 1.5
           3 | tree: [Look, {Pick: {tries: 1.5}}]
             |                             ^^^
        """,
    ),
    "out of range": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, {Pick: {height: 2}}]
        """,
        """
        m.yaml:3:30: error[out-of-range]: Pick.height must be at most 0.5 m, not 2
           3 | tree: [Look, {Pick: {height: 2}}]
             |                              ^
        """,
    ),
    "not a choice": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {view: ful}
        """,
        """
        m.yaml:4:18: error[wrong-value]: Look.view must be "table" or "full", not the text "ful" (did you mean "full"?)
           4 |   - Look: {view: ful}
             |                  ^^^
        """,
    ),
    "missing param": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, Pick, Drop]
        """,
        """
        m.yaml:3:20: error[missing-param]: Drop needs the param "bin"
           3 | tree: [Look, Pick, Drop]
             |                    ^^^^
          bin: where it goes.
        """,
    ),
    "param variable": (
        """
        mission: m
        cell: cells/small.yaml
        params: {hight: 0.2}
        tree: [Look, {Pick: {height: $higt}}]
        """,
        """
        m.yaml:4:30: error[unknown-param]: Pick.height is a constant, and $higt is neither param nor argument here
           4 | tree: [Look, {Pick: {height: $higt}}]
             |                              ^^^^^
          Did you mean "$hight"? The mission's params: $hight.
        """,
    ),
    "input literal": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, {Pick: {seen: seen}}]
        """,
        """
        m.yaml:3:28: error[wrong-type]: Pick.seen must be a list, not the text "seen"
           3 | tree: [Look, {Pick: {seen: seen}}]
             |                            ^^^^
          For the variable write $seen.
        """,
    ),
    "output literal": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {seen: other}
        """,
        """
        m.yaml:4:18: error[wrong-type]: Look.seen is an output: it takes the variable to write, as $seen
           4 |   - Look: {seen: other}
             |                  ^^^^^
        """,
    ),
    "unwritten": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Pick
        """,
        """
        m.yaml:4:5: error[unwritten]: Pick.seen reads $seen, which nothing writes
           4 |   - Pick
             |     ^^^^
          It is written by: Look.
        """,
    ),
    "unwritten explicit": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, {Pick: {seen: $sen}}]
        """,
        """
        m.yaml:3:28: error[unwritten]: Pick.seen reads $sen, which nothing writes
           3 | tree: [Look, {Pick: {seen: $sen}}]
             |                            ^^^^
          Did you mean "$seen"? Variables that are written: $held, $seen.
        """,
    ),
    "shadowed": (
        """
        mission: m
        cell: cells/small.yaml
        params: {seen: 1}
        tree: [Look, {repeat: {times: $seen, do: Look}}]
        """,
        """
        m.yaml:4:8: error[shadowed-param]: Look.seen would write $seen, but that is a param of the mission
           4 | tree: [Look, {repeat: {times: $seen, do: Look}}]
             |        ^^^^
          Rename that, or write seen: $other.
        m.yaml:4:42: error[shadowed-param]: Look.seen would write $seen, but that is a param of the mission
           4 | tree: [Look, {repeat: {times: $seen, do: Look}}]
             |                                          ^^^^
          Rename that, or write seen: $other.
        """,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_skills_finding_reads(case: str, load: Callable[..., LoadedMission]) -> None:
    mission, expected = CASES[case]
    with pytest.raises(MissionError) as caught:
        load(dedent(mission).lstrip())
    assert str(caught.value) == dedent(expected).strip()
