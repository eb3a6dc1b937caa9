"""`executive tree`: the tree of a mission in every form."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import main
from executive.mission.text.file_search import get_shipped_folder

SHIPPED = sorted(path.stem for path in get_shipped_folder().glob("*.yaml"))
QUICK = ("sort_overhead", "kit_fasteners")

EVERY_NODE = """
mission: every_node
cell: cells/overhead.yaml
routes: {cube: red_bin, duck: yellow_bin}
tree:
  for_each:
    each: kind
    in: [cube, duck]
    do:
      repeat:
        times: 5
        until: [SelectTarget.unseen]
        do:
          - parallel:
              wait_for: all
              do: [{use: look}, {timeout: {seconds: 20, do: MoveToScan}}]
          - SelectTarget: {wanted: $kind}
          - while:
              condition: {invert: {SelectTarget: {same: $item}}}
              do: {fallback: [{use: look}, succeed]}
          - try:
              retry:
                attempts: 3
                on: [Grasp.missed]
                recover: {use: look}
                backoff: {first: 0.5, factor: 2, max: 8}
                do: [Approach, Grasp, Transit, Release]
              as: pick
            catch:
              - on: [Grasp.missed, Approach.no_contact]
                do: {RejectTarget: {why: "<b>&\\"'\\x1b ü"}}
            finally: {succeed: MoveToScan}
trees:
  look: {args: {view: table}, do: [{Detect: {view: $view}}, Localize]}
"""


def shown(*words: str) -> Result:
    return CliRunner().invoke(main, ["tree", *words])


@pytest.fixture
def every_node(tmp_path: Path) -> str:
    """Return a mission with every control node, and a param that means something in XML."""
    shutil.copytree(get_shipped_folder() / "cells", tmp_path / "cells")
    path = tmp_path / "every_node.yaml"
    path.write_text(EVERY_NODE, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    "mission", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in SHIPPED]
)
def test_every_shipped_mission_is_shown_in_every_form(mission):
    nodes = json.loads(shown(mission, "--json").stdout)
    picture = ElementTree.fromstring(shown(mission, "--svg").stdout)
    groups = [group for group in picture.iter() if "node" in group.attrib.get("class", "").split()]
    assert [group.attrib["data-path"] for group in groups] == [node["path"] for node in nodes]
    assert len({group.attrib["id"] for group in groups}) == len(nodes)
    assert shown(mission).stdout.startswith(nodes[0]["name"])


def test_what_a_mission_says_cannot_break_the_picture(every_node):
    picture = shown(every_node, "--svg").stdout
    elements = ElementTree.fromstring(picture).iter("{http://www.w3.org/2000/svg}title")
    (reject,) = [title for title in (element.text or "" for element in elements) if "RejectTarget" in title]
    assert "why: <b>&\"'\ufffd ü" in reject.splitlines()
    assert "<b>" not in picture


def test_ports_and_reasons_are_printed_on_demand(every_node):
    plain, full = shown(every_node).stdout, shown(every_node, "--ports", "--reasons").stdout
    assert "reads" not in plain and "may fail" not in plain
    assert "reads $targets, $same?, wanted <- $kind?, $among?, $not?; writes $target, $item" in full
    assert "may fail: no_candidate, unseen" in full
    assert max(map(len, full.splitlines())) <= 100
    given = shown("sort_overhead", "--reasons", "--set", "attempts=9").stdout
    assert "on Transit.unreachable, Transit.blocked" in given and "up to 9 attempts" in given


def test_the_format_has_the_same_names_as_the_flags(every_node):
    for name in ("svg", "json"):
        assert shown(every_node, "--format", name).stdout == shown(every_node, f"--{name}").stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--format", "btcpp", "--svg"), "--svg and --format btcpp exclude each other"),
        (("--svg", "--json"), "--svg and --json exclude each other"),
        (("--svg", "--ports"), "--svg always contains ports and reasons; omit --ports"),
    ],
)
def test_forms_that_exclude_each_other_are_refused(words, sentence):
    result = shown("sort_overhead", *words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert sentence in result.stderr


def test_a_folded_tree_shows_every_subtree_once():
    text = shown("sort_overhead", "--fold").stdout
    assert text.count("view: full, doubtful: pass") == 1, "the only one of its kind is in look"
    assert [line.strip("│├└─ ") for line in text.splitlines() if "as above" in line] == [
        "recover look: try  (as above, other params)",
        "look: try  (as above)", "look: try  (as above, other params)",
        "look: try  (as above, other params)", "recover find_again: retry  (as above, other params)",
    ]  # fmt: skip
    picture = ElementTree.fromstring(shown("sort_overhead", "--fold", "--svg").stdout)
    assert [part.attrib["data-kind"] for part in picture if "use" in part.attrib.get("class", "")] == [
        "use"
    ] * 5
