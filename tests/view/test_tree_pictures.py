"""The tree as an SVG picture."""

from __future__ import annotations

import re
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from executive.mission.outline import Connection, OutlineNode
from executive.tree.node import ControlNode, load_control_nodes
from executive.view.drawing import NodeBox, NodeResult, make_group_id, make_svg, place_boxes

RETRY = "up to 3 attempts, on Grasp.missed, Grasp.blocked"
SVG = "{http://www.w3.org/2000/svg}"


def control(path: str, depth: int, word: str, **more) -> OutlineNode:
    kind = load_control_nodes().get(word, ControlNode)
    detail, title = more.pop("detail", ""), more.pop("title", word)
    return OutlineNode(path, word, depth, detail, word, title, symbol=kind.symbol, **more)


def skill(path: str, depth: int, name: str, **more) -> OutlineNode:
    detail, title = more.pop("detail", ""), more.pop("title", name)
    return OutlineNode(path, name, depth, detail, "skill", title, skill=name, **more)


NODES = [
    control("tree/try", 0, "try"),
    control("tree/try/retry", 1, "retry", parent_key="do", detail=RETRY),
    skill(
        "tree/try/retry/do/Grasp", 2, "Grasp", parent_key="do", doc="Close the tool.", detail="settle: 0.2",
        reads=(Connection("target", "target", True), Connection("only", "item", False)),
        writes=(Connection("held", "thing", True),), reasons=("missed", "blocked"),
    ),
    control(
        "tree/try/catch/1/look", 1, "sequence", parent_key="catch 1", trigger="on Grasp.missed",
        subtrees=("look",),
    ),
    skill("tree/try/catch/1/look/2:Detect", 2, "Detect", title="again", detail="Detect, view: full"),
]  # fmt: skip


def parsed(nodes: list[OutlineNode], name: str = "sort", **notes: NodeResult) -> Element:
    return ElementTree.fromstring(
        make_svg(nodes, name, {node.path: notes.get(node.title, NodeResult()) for node in nodes})
    )


def groups(picture: Element) -> dict[str, Element]:
    """Return the groups of the nodes by path."""
    return {
        group.attrib["data-path"]: group
        for group in picture.iter(f"{SVG}g")
        if "node" in group.attrib["class"].split()
    }


def texts(group: Element, kind: str) -> list[str | None]:
    return [text.text for text in group.iter(f"{SVG}text") if text.attrib["class"] == kind]


def tooltip(group: Element) -> str:
    return group.findtext(f"{SVG}title") or ""


def test_every_node_is_a_group_with_its_symbol_title_and_short_lines_and_a_subtree_one_with_its_name():
    picture = parsed(NODES)
    found = groups(picture)
    assert [group.attrib["data-kind"] for group in found.values()] == [node.kind for node in NODES]
    shown = {
        path: [texts(group, kind) for kind in ("edge-label", "symbol", "title", "line")]
        for path, group in found.items()
    }
    assert shown == {
        "tree/try": [[], ["↯"], ["try"], []],
        "tree/try/retry": [
            ["do"], ["↻"], ["retry"], ["up to 3 attempts,", "on Grasp.missed,", "Grasp.blocked"]
        ],
        "tree/try/retry/do/Grasp": [["do"], [], ["Grasp"], ["settle: 0.2"]],
        "tree/try/catch/1/look": [["catch 1"], ["→"], ["sequence"], ["on Grasp.missed"]],
        "tree/try/catch/1/look/2:Detect": [[], [], ["again"], ["Detect, view: full"]],
    }  # fmt: skip
    assert found["tree/try/catch/1/look/2:Detect"].attrib["id"] == "node-tree-try-catch-1-look-2--3a-Detect"
    (frame,) = [group for group in picture.iter(f"{SVG}g") if group.attrib["class"] == "subtree"]
    assert (frame.attrib["data-path"], texts(frame, "name")) == ("tree/try/catch/1/look", ["look"])


def test_an_id_says_its_path_and_no_two_are_alike():
    paths = ["a/b", "a-b", "a_b", "a:b", "a.b", "a b", "a/ü", "a/:b", 'a"b']
    found = [make_group_id(path) for path in paths]
    assert len(set(found)) == len(paths)
    assert all(re.fullmatch(r"node-[A-Za-z0-9_-]+", each) for each in found)


def test_the_title_of_a_node_says_everything():
    found = groups(parsed(NODES))
    assert tooltip(found["tree/try/retry/do/Grasp"]).splitlines() == [
        "Grasp", "Close the tool.", "settle: 0.2", "reads $target, only <- $item?", "writes held -> $thing",
        "may fail: missed, blocked", "tree/try/retry/do/Grasp",
    ]  # fmt: skip
    assert tooltip(found["tree/try/catch/1/look/2:Detect"]).startswith("again: Detect\n")


def test_a_note_stands_below_what_the_mission_says_in_a_box_with_room_for_it():
    message = "missed: no seal on big_yellow_duck-12 within 0.10 s after contact"
    plain = groups(parsed(NODES))
    noted = groups(
        parsed(NODES, Grasp=NodeResult("FAILURE", ("1 done, 2 failed", message)), retry=NodeResult("RUNNING"))
    )
    grasp = "tree/try/retry/do/Grasp"
    texts = sorted(noted[grasp].iter(f"{SVG}text"), key=lambda text: float(text.attrib["y"]))
    assert [(text.attrib["class"], text.text) for text in texts if text.attrib["class"] != "edge-label"] == [
        ("title", "Grasp"), ("line", "settle: 0.2"), ("note", "1 done, 2 failed"),
        ("note", "missed: no seal on …"),
    ]  # fmt: skip
    assert tooltip(noted[grasp]) == f"{tooltip(plain[grasp])}\n1 done, 2 failed\n{message}"
    assert [float(box(each[grasp])["height"]) for each in (plain, noted)] == [42, 70]
    assert [group.attrib["class"] for group in noted.values()] == [
        "node control try", "node control retry running", "node skill failure", "node control sequence",
        "node skill",
    ]  # fmt: skip


def box(group: Element) -> dict[str, str]:
    (found,) = (rect for rect in group.iter(f"{SVG}rect") if rect.attrib["class"] == "box")
    return found.attrib


def test_the_picture_is_drawn_exactly_there():
    found = groups(parsed(NODES[:3]))
    grasp, retry = found["tree/try/retry/do/Grasp"], found["tree/try/retry"]
    assert [box(retry)[key] for key in ("x", "y", "width", "height", "rx")] == ["137", "16", "163", "70", "5"]
    (edge,) = grasp.iter(f"{SVG}path")
    assert edge.attrib["d"] == "M300 51H350"
    places = [(text.attrib["x"], text.attrib["y"]) for text in retry.iter(f"{SVG}text")]
    assert places[:4] == [("111", "47"), ("151", "35"), ("169", "34"), ("169", "48")]


def test_a_small_tree_stands_exactly_there():
    boxes = [
        NodeBox(0, 60, 28),
        NodeBox(1, 50, 28, label_width=20),
        NodeBox(1, 40, 42, subtree_name_width=90),
        NodeBox(2, 30, 28),
    ]
    boxes[0].children = boxes[1:3]
    boxes[2].children = boxes[3:]
    assert place_boxes(boxes) == (274, 141)
    assert [box.bounds for box in boxes] == [
        (16, 16, 60, 28), (137, 16, 50, 28), (137, 74, 40, 42), (219, 81, 30, 28),
    ]  # fmt: skip
    assert [box.edge_x for box in boxes] == [16, 92, 92, 203]
    assert boxes[2].frame == (128, 54, 130, 71)
