# ruff: noqa: E501 - findings are quoted as they are printed
"""Findings about the form of a mission file, word for word."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import dedent

import pytest

from executive.mission.findings import MissionError
from executive.mission.load import LoadedMission

CASES = {
    "syntax": (
        """
        mission: m
        tree: [Look, {Pick: }
        """,
        """
        m.yaml:2:21: error[yaml]: not valid YAML: while parsing a flow sequence that began in line 2: expected ',' or ']', but got '<stream end>'
           2 | tree: [Look, {Pick: }
             |                     ^
          A bracket or brace that was opened is not closed.
        """,
    ),
    "unknown top key": (
        """
        mission: m
        cell: cells/small.yaml
        tre: Look
        tree: Look
        """,
        """
        m.yaml:3:1: error[unknown-key]: the mission has no key "tre"
           3 | tre: Look
             | ^^^
          Did you mean "tree"? It takes: mission, description, cell, library, params, routes, tree, trees.
        """,
    ),
    "missing keys": (
        """
        description: nothing else
        """,
        """
        m.yaml:1:1: error[missing-key]: the mission needs the key "mission"
           1 | description: nothing else
             | ^
        m.yaml:1:1: error[missing-key]: the mission needs the key "cell"
           1 | description: nothing else
             | ^
        m.yaml:1:1: error[missing-key]: the mission needs the key "tree"
           1 | description: nothing else
             | ^
        """,
    ),
    "duplicate key": (
        """
        mission: m
        cell: cells/small.yaml
        tree: Look
        tree: Pick
        """,
        """
        m.yaml:4:1: error[duplicate-key]: the key "tree" stands here twice; the first is in line 3
           4 | tree: Pick
             | ^^^^
        """,
    ),
    "bad mission name": (
        """
        mission: ../m
        cell: cells/small.yaml
        tree: Look
        """,
        """
        m.yaml:1:10: error[bad-name]: a mission is named by letters, digits, "_" and "-", at most 64, not "../m"
           1 | mission: ../m
             |          ^^^^
        """,
    ),
    "not a mapping": (
        """
        - Look
        """,
        """
        m.yaml:1:1: error[wrong-type]: the mission takes a mapping, not a list of 1
           1 | - Look
             | ^
          It takes: mission, description, cell, library, params, routes, tree, trees.
        """,
    ),
    "unknown control": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          rety: {attempts: 2, do: Look}
        """,
        """
        m.yaml:4:3: error[unknown-node]: there is no control node "rety"
           4 |   rety: {attempts: 2, do: Look}
             |   ^^^^
          Did you mean "retry"? Control nodes are: sequence, fallback, parallel, retry, repeat, while, for_each, try, timeout, invert, succeed, use. A subtree is written as use: NAME.
        """,
    ),
    "unknown control key": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          retry: {attemps: 2, do: Look}
        """,
        """
        m.yaml:4:3: error[missing-key]: retry needs the key "attempts"
           4 |   retry: {attemps: 2, do: Look}
             |   ^^^^^
        m.yaml:4:11: error[unknown-key]: retry has no key "attemps"
           4 |   retry: {attemps: 2, do: Look}
             |           ^^^^^^^
          Did you mean "attempts"? It takes: attempts, on, recover, backoff, do.
        """,
    ),
    "bare control": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [retry]
        """,
        """
        m.yaml:3:8: error[missing-node]: "retry" needs a body: write retry: ...
           3 | tree: [retry]
             |        ^^^^^
        """,
    ),
    "two nodes": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {Look: {}, Pick: {}}
        """,
        """
        m.yaml:3:18: error[two-nodes]: "Look" and "Pick" stand in one node; a node has one name
           3 | tree: {Look: {}, Pick: {}}
             |                  ^^^^
          Write a list to run one after the other.
        """,
    ),
    "beside": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {retry: {attempts: 2, do: Look}, catch: []}
        """,
        """
        m.yaml:3:40: error[unknown-key]: "catch" may not stand beside "retry"
           3 | tree: {retry: {attempts: 2, do: Look}, catch: []}
             |                                        ^^^^^
          Beside retry may stand: as.
        """,
    ),
    "empty list": (
        """
        mission: m
        cell: cells/small.yaml
        tree: []
        """,
        """
        m.yaml:3:7: error[empty-list]: a list of steps needs at least one node
           3 | tree: []
             |       ^
        """,
    ),
    "missing node": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look
          -
        """,
        """
        m.yaml:5:4: error[missing-node]: a node is missing here
           5 |   -
             |    ^
        """,
    ),
    "bad label": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {Look: {}, as: First}
        """,
        """
        m.yaml:3:22: error[bad-label]: a label is a lower-case word, not "First"
           3 | tree: {Look: {}, as: First}
             |                      ^^^^^
        """,
    ),
    "repeat neither": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {repeat: {do: Look}}
        """,
        """
        m.yaml:3:8: error[missing-key]: repeat needs one of "until" and "times", to know when it is done
           3 | tree: {repeat: {do: Look}}
             |        ^^^^^^
        """,
    ),
    "try alone": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {try: Look}
        """,
        """
        m.yaml:3:8: error[missing-key]: try needs a "catch" or a "finally" beside it
           3 | tree: {try: Look}
             |        ^^^
        """,
    ),
    "with not mapping": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: look, with: full}
        trees: {look: Look}
        """,
        """
        m.yaml:3:25: error[wrong-type]: with takes a mapping of names to values, not the text "full"
           3 | tree: {use: look, with: full}
             |                         ^^^^
          Write it as with: {name: full}.
        """,
    ),
    "skill not mapping": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {Look: full}
        """,
        """
        m.yaml:3:14: error[wrong-type]: Look takes a mapping of names to values, not the text "full"
           3 | tree: {Look: full}
             |              ^^^^
          Write it as Look: {view: full}.
        """,
    ),
    "subtree without do": (
        """
        mission: m
        cell: cells/small.yaml
        tree: Look
        trees:
          other: {doc: Nothing., args: {}}
        """,
        """
        m.yaml:5:3: error[missing-key]: the subtree "other" needs the key "do"
           5 |   other: {doc: Nothing., args: {}}
             |   ^^^^^
        """,
    ),
    "retry not mapping": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          retry: 3
        """,
        """
        m.yaml:4:10: error[wrong-type]: retry takes a mapping, not 3
           4 |   retry: 3
             |          ^
          It takes: attempts, on, recover, backoff, do.
        """,
    ),
    "route type": (
        """
        mission: m
        cell: cells/small.yaml
        routes: {cube: [red_bin, 3]}
        tree: Look
        """,
        """
        m.yaml:3:26: error[wrong-type]: a route names a bin or a list of bins, not 3
           3 | routes: {cube: [red_bin, 3]}
             |                          ^
        """,
    ),
    "match form": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {retry: {attempts: 2, on: unsure, do: Look}}
        """,
        """
        m.yaml:3:33: error[bad-match]: retry.on names failures as Skill.reason or label.reason, not "unsure"
           3 | tree: {retry: {attempts: 2, on: unsure, do: Look}}
             |                                 ^^^^^^
        """,
    ),
    "bad reference": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {classes: [$kind]}
        """,
        """
        m.yaml:4:22: error[bad-reference]: "$kind" is no reference: only a whole value can be one, as in key: $name
           4 |   - Look: {classes: [$kind]}
             |                      ^^^^^
          For the text itself write "$$kind".
        """,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_form_finding_reads(case: str, load: Callable[..., LoadedMission]) -> None:
    mission, expected = CASES[case]
    with pytest.raises(MissionError) as caught:
        load(dedent(mission).lstrip())
    assert str(caught.value) == dedent(expected).strip()
