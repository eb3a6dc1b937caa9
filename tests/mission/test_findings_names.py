# ruff: noqa: E501 - findings are quoted as they are printed
"""Findings about names: of the cell, of failures, of subtrees, word for word."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import dedent

import pytest

from executive.mission.findings import MissionError
from executive.mission.load import LoadedMission

CASES = {
    "unknown bin": (
        """
        mission: m
        cell: cells/small.yaml
        tree: [Look, Pick, {Drop: {bin: red_bni}}]
        """,
        """
        m.yaml:3:33: error[unknown-bin]: the cell has no bin "red_bni" for Drop.bin
           3 | tree: [Look, Pick, {Drop: {bin: red_bni}}]
             |                                 ^^^^^^^
          Did you mean "red_bin"? Drop.bin takes: red_bin, blue_bin.
        """,
    ),
    "unknown detector": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {detector: x}
        """,
        """
        m.yaml:4:22: error[unknown-detector]: the cell has no detector "x" for Look.detector
           4 |   - Look: {detector: x}
             |                      ^
          Look.detector takes: first.
        """,
    ),
    "unknown pose": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {pose: hoem}
        """,
        """
        m.yaml:4:18: error[unknown-pose]: the cell has no pose "hoem" for Look.pose
           4 |   - Look: {pose: hoem}
             |                  ^^^^
          Did you mean "home"? Look.pose takes: home, scan, auto, next.
        """,
    ),
    "unknown class": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - Look: {classes: [cube, goose]}
        """,
        """
        m.yaml:4:28: error[unknown-class]: the cell has no class "goose" for Look.classes
           4 |   - Look: {classes: [cube, goose]}
             |                            ^^^^^
          Look.classes takes: cube, sphere.
        """,
    ),
    "route bin": (
        """
        mission: m
        cell: cells/small.yaml
        routes: {cube: rde_bin}
        tree: Look
        """,
        """
        m.yaml:3:16: error[unknown-bin]: the cell has no bin "rde_bin"
           3 | routes: {cube: rde_bin}
             |                ^^^^^^^
          Did you mean "red_bin"? Its bins: red_bin, blue_bin.
        """,
    ),
    "route class": (
        """
        mission: m
        cell: cells/small.yaml
        routes: {cub: red_bin}
        tree: Look
        """,
        """
        m.yaml:3:10: error[unknown-class]: the cell knows no class "cub"
           3 | routes: {cub: red_bin}
             |          ^^^
          Did you mean "cube"? Its classes: cube, sphere.
        """,
    ),
    "match reason": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {retry: {attempts: 2, on: [Look.unsur], do: Look}}
        """,
        """
        m.yaml:3:34: error[unknown-reason]: Look never fails with "unsur"
           3 | tree: {retry: {attempts: 2, on: [Look.unsur], do: Look}}
             |                                  ^^^^^^^^^^
          Did you mean "unsure"? Look may fail with: unsure, hidden.
        """,
    ),
    "match skill": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {repeat: {until: Lok.unsure, do: Look}}
        """,
        """
        m.yaml:3:24: error[unknown-skill]: there is no skill or label "Lok"
           3 | tree: {repeat: {until: Lok.unsure, do: Look}}
             |                        ^^^^^^^^^^
          Did you mean "Look"? In the body: Look.
        """,
    ),
    "match elsewhere": (
        """
        mission: m
        cell: cells/small.yaml
        tree:
          - try: Look
            catch:
              - {on: [Pick.missed], do: succeed}
        """,
        """
        m.yaml:6:15: error[impossible-reason]: Pick is not in the body of this try, so Pick.missed cannot come from it
           6 |       - {on: [Pick.missed], do: succeed}
             |               ^^^^^^^^^^^
          In the body: Look.
        """,
    ),
    "unknown tree": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: lok}
        trees: {look: Look}
        """,
        """
        m.yaml:3:13: error[unknown-tree]: there is no subtree "lok"
           3 | tree: {use: lok}
             |             ^^^
          Did you mean "look"? The mission's subtrees: look.
        """,
    ),
    "unknown argument": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: look, with: {veiw: full}}
        trees:
          look: {args: {view: table}, do: {Look: {view: $view}}}
        """,
        """
        m.yaml:3:26: error[unknown-argument]: the subtree "look" has no argument "veiw"
           3 | tree: {use: look, with: {veiw: full}}
             |                          ^^^^
          Did you mean "view"? Its arguments: view.
        """,
    ),
    "missing argument": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: look}
        trees:
          look: {args: [where], do: {Look: {view: $where}}}
        """,
        """
        m.yaml:3:13: error[missing-argument]: the subtree "look" needs the argument "where"
           3 | tree: {use: look}
             |             ^^^^
          Write with: {where: ...} beside it.
        """,
    ),
    "argument value": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: look, with: {view: ful}}
        trees:
          look: {args: {view: table}, do: {Look: {view: $view}}}
        """,
        """
        m.yaml:3:32: error[wrong-value]: Look.view must be "table" or "full", not the text "ful" (did you mean "full"?) (it is $view in line 5)
           3 | tree: {use: look, with: {view: ful}}
             |                                ^^^
        """,
    ),
    "recursive": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: a}
        trees:
          a: {use: b}
          b: [Look, {use: a}]
        """,
        """
        m.yaml:6:19: error[recursive-use]: a subtree cannot use itself: a -> b -> a
           6 |   b: [Look, {use: a}]
             |                   ^
        """,
    ),
    "returns": (
        """
        mission: m
        cell: cells/small.yaml
        tree: {use: a}
        trees:
          a: {returns: [held], do: Look}
        """,
        """
        m.yaml:5:17: error[unwritten]: the subtree "a" returns $held, which nothing in it writes
           5 |   a: {returns: [held], do: Look}
             |                 ^^^^
          It writes: seen.
        """,
    ),
    "unused": (
        """
        mission: m
        cell: cells/small.yaml
        tree: Look
        trees:
          other: Lok
        """,
        """
        m.yaml:5:3: warning[unused-tree]: nothing uses the subtree "other"
           5 |   other: Lok
             |   ^^^^^
        m.yaml:5:10: error[unknown-skill]: there is no skill "Lok"
           5 |   other: Lok
             |          ^^^
          Did you mean "Look"? Installed skills: Look, Pick, Drop.
        """,
    ),
    "cell outside": (
        """
        mission: m
        cell: ../cells/small.yaml
        tree: Look
        """,
        """
        m.yaml:2:7: error[no-cell]: "../cells/small.yaml" is not below the folder of the file that names it; give a relative path without ".."
           2 | cell: ../cells/small.yaml
             |       ^^^^^^^^^^^^^^^^^^^
        """,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_names_finding_reads(case: str, load: Callable[..., LoadedMission]) -> None:
    mission, expected = CASES[case]
    with pytest.raises(MissionError) as caught:
        load(dedent(mission).lstrip())
    assert str(caught.value) == dedent(expected).strip()
