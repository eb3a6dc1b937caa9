"""What is known about a tree's nodes, and the tree as text."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour

from executive.mission.outline import list_child_indices, make_outline
from executive.skill import In, Metres, Out, Skill, param, port
from executive.tree.blackboard import Blackboard, NodeContext, Wiring
from executive.tree.retry import Catch, Retry, TryCatch
from executive.tree.sequences import Sequence
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.specification import Reason
from executive.view.drawing import draw_text, fold_subtrees
from tests.node_behaviours import build, specify

CELL: Any = SimpleNamespace()
MISSED = (Reason("Pick", "missed"),)


class Pick(Skill):
    """Take something.

    Succeeds when it is held.
    """

    seen: In[list[int]] = port(doc="a value")
    only: In[str | None] = port(default=None, doc="a value")
    height: Metres = param(0.1, doc="a height")
    held: Out[str] = port(doc="a value")
    reasons: ClassVar = ("missed", "blocked")


def make_site(path: str, label: str = "") -> NodeContext:
    nothing: Any = None
    return NodeContext(path, nothing, nothing, Blackboard(), label)


def pick(path: str, label: str = "", wiring: Wiring | None = None) -> SkillLeaf:
    wired = Wiring({"height": 0.2}, {"seen": "seen", "only": "item"}, {"held": "thing"})
    return SkillLeaf(make_site(path, label), "Pick", Pick, wiring or wired, CELL)


def in_subtree(node: Behaviour, *subtrees: str) -> Behaviour:
    node.subtree_names = subtrees
    return node


def look(path: str, height: float = 0.2) -> Behaviour:
    wiring = Wiring({"height": height})
    return in_subtree(build(make_site(path), Sequence, do=[pick(f"{path}/Pick", wiring=wiring)]), "look")


def tree() -> Behaviour:
    """Return a retry in a try, whose catch and recovery use the subtree `look`."""
    retry = build(
        make_site("tree/try/retry"), Retry, attempts=3, on=MISSED, do=pick("tree/try/retry/do/Pick"),
        recover=look("tree/try/retry/recover/look"),
    )  # fmt: skip
    catch = [Catch(on=MISSED, do=specify(look("tree/try/catch/1/look", 0.3)))]
    return build(
        make_site("tree/try"), TryCatch, do=retry, catch=catch, finally_=look("tree/try/finally/look")
    )


def test_every_node_knows_its_children_what_it_is_to_its_parent_and_which_subtree_begins_with_it():
    nodes = make_outline(tree())
    look, taken = ("sequence", ("look",)), ("", "Pick", ())
    assert [(node.parent_key, node.title, node.subtrees) for node in nodes] == [
        ("", "try", ()), ("do", "retry", ()), ("recover", *look), taken, ("do", "Pick", ()),
        ("catch 1", *look), taken, ("finally", *look), taken,
    ]  # fmt: skip
    assert list_child_indices(nodes) == [[1, 5, 7], [2, 4], [3], [], [], [6], [], [8], []]


def test_ports_and_reasons_stand_below_the_skill():
    nodes = make_outline(
        build(make_site("tree"), Sequence, do=[pick("tree/Pick"), pick("tree/other", "other")])
    )
    assert draw_text(nodes, shows_ports=True, shows_reasons=True).splitlines() == [
        "tree",
        "├─ Pick  (height: 0.2, only: $item, held: $thing)",
        "│     reads $seen, only <- $item?; writes held -> $thing",
        "│     may fail: missed, blocked",
        "└─ other  (Pick, height: 0.2, only: $item, held: $thing)",
        "      reads $seen, only <- $item?; writes held -> $thing",
        "      may fail: missed, blocked",
    ]


def test_a_folded_tree_shows_every_subtree_once():
    nodes = make_outline(tree())
    shown = fold_subtrees(nodes)
    assert draw_text(shown).splitlines() == [
        "try",
        "├─ retry  (up to 3 attempts, on Pick.missed)",
        "│  ├─ recover: look",
        "│  │  └─ Pick  (height: 0.2)",
        "│  └─ do: Pick  (height: 0.2, only: $item, held: $thing)",
        "├─ catch 1: look  (as above, other params)",
        "└─ finally: look  (as above)",
    ]
    assert [(node.kind, node.title, node.parent_key) for node in shown if node.kind == "use"] == [
        ("use", "look", "catch 1"), ("use", "look", "finally"),
    ]  # fmt: skip
    assert [node for node in shown if node.kind != "use"] == nodes[:5]


def test_a_folded_subtree_stays_within_those_around_it():
    first, second = look("tree/1:look"), look("tree/2:wide/look")
    shown = fold_subtrees(
        make_outline(build(make_site("tree"), Sequence, do=[first, in_subtree(second, "wide", "look")]))
    )
    assert [(node.title, node.subtrees) for node in shown[2:]] == [("Pick", ()), ("look", ("wide",))]
