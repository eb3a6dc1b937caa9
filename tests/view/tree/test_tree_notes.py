"""What the picture of a tree says of nodes that ran."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from executive.mission.outline import OutlineNode
from executive.view.tree.card import COLUMNS
from executive.view.tree.svg import Note, svg

SVG = "{http://www.w3.org/2000/svg}"
GRASP = "tree/Grasp"
NODES = [
    OutlineNode("tree", "tree", 0, "", "sequence", "sequence"),
    OutlineNode(GRASP, "Grasp", 1, "settle: 0.2", "skill", "Grasp", skill="Grasp"),
    OutlineNode("tree/Wait", "Wait", 1, "", "skill", "Wait", skill="Wait"),
]


def groups(notes: dict[str, Note]) -> dict[str, Element]:
    """Draw the tree with notes, and return the groups of its nodes by path."""
    picture = ElementTree.fromstring(svg(NODES, "trial", notes))
    return {
        group.attrib["data-path"]: group
        for group in picture.iter(f"{SVG}g")
        if "node" in group.attrib["class"].split()
    }


def lines(group: Element) -> list[tuple[str, str | None]]:
    """Return the lines of a node, from above, each with its kind."""
    texts = sorted(group.iter(f"{SVG}text"), key=lambda text: float(text.attrib["y"]))
    return [(text.attrib["class"], text.text) for text in texts]


def test_a_note_stands_below_what_the_mission_says():
    found = groups({GRASP: Note("FAILURE", ("1 done, 2 failed", "missed: air"))})
    assert lines(found[GRASP]) == [
        ("title", "Grasp"), ("line", "settle: 0.2"), ("note", "1 done, 2 failed"), ("note", "missed: air"),
    ]  # fmt: skip
    assert lines(found["tree/Wait"]) == [("title", "Wait")]


@pytest.mark.parametrize("status", ["SUCCESS", "FAILURE", "RUNNING", "INVALID"])
def test_a_node_has_the_class_of_how_it_ended(status):
    found = groups({GRASP: Note(status), "tree": Note(status)})
    assert found[GRASP].attrib["class"] == f"node skill {status.lower()}"
    assert found["tree"].attrib["class"] == f"node control sequence {status.lower()}"
    assert found["tree/Wait"].attrib["class"] == "node skill"


def test_a_line_that_is_too_long_is_cut_and_stands_whole_where_the_pointer_rests():
    message = "missed: no seal on big_yellow_duck-12 within 0.10 s after contact"
    (group,) = (
        group for path, group in groups({GRASP: Note("FAILURE", (message,))}).items() if path == GRASP
    )
    ((_, shown),) = (line for line in lines(group) if line[0] == "note")
    assert shown is not None
    assert len(shown) <= COLUMNS
    assert shown.endswith("…")
    assert (group.findtext(f"{SVG}title") or "").splitlines()[-1] == message


def test_a_note_about_a_node_that_is_not_there_and_one_without_words_change_nothing():
    assert svg(NODES, "trial", {"tree/Approach": Note("SUCCESS", ("1 done",))}) == svg(NODES, "trial")
    assert svg(NODES, "trial", {GRASP: Note()}) == svg(NODES, "trial")
