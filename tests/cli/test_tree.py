"""`executive tree`: the tree of a mission in every form."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.text.files import get_shipped_folder

SHIPPED = sorted(path.stem for path in get_shipped_folder().glob("*.yaml"))
QUICK = ("sort_overhead", "kit_fasteners")


def shown(*words: str) -> Result:
    return invoke("tree", *words)


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


def test_ports_and_reasons_are_printed_on_demand():
    plain = shown("sort_overhead").stdout
    full = shown("sort_overhead", "--ports", "--reasons").stdout
    assert "reads" not in plain and "may fail" not in plain
    assert "may fail: no_candidate, unseen" in full and "; writes $target" in full
    assert max(map(len, full.splitlines())) <= 100
    given = shown("sort_overhead", "--reasons", "--set", "attempts=9").stdout
    assert "on Transit.unreachable, Transit.blocked" in given and "up to 9 attempts" in given


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
    assert text.count("as above") == 5
    assert "  (as above)" in text and "  (as above, other params)" in text
