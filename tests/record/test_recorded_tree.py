"""The tree of a recorded run, written and read."""

from __future__ import annotations

import math

import pytest

from executive.errors import InputError
from executive.mission.outline import Connection, OutlineNode
from executive.record.recorded_tree import read_tree, tree_text

ROOT = OutlineNode("tree/retry", "retry", 0, "3 attempts", "retry", "retry")
LEAF = OutlineNode(
    "tree/retry/do/Grasp", "do: Grasp", 1, "", "skill", "Grasp", "do", "on Grasp.missed", ("pick",), "Grasp",
    "Close the tool.", {"settle": 0.1}, (Connection("target", "target", True),), (), ("missed",),
)  # fmt: skip


def test_what_is_written_is_read(tmp_path):
    file = tmp_path / "tree.json"
    file.write_text(tree_text([ROOT, LEAF]))
    assert read_tree(file) == [ROOT, LEAF]


def test_values_that_json_lacks_become_text(tmp_path):
    file = tmp_path / "tree.json"
    file.write_text(
        tree_text([OutlineNode("a", "a", 0, "", "skill", "A", params={"x": math.inf, "y": object})])
    )
    read = read_tree(file)[0].params
    assert read["x"] == "Infinity" and "object" in read["y"]


def test_a_directory_without_one(tmp_path):
    with pytest.raises(InputError) as refused:
        read_tree(tmp_path / "tree.json")
    assert str(refused.value) == (
        f'cannot read the tree "{tmp_path}/tree.json": no such file or directory; '
        "every run leaves one beside its journal since version 0.1"
    )


def test_something_else_in_its_place(tmp_path):
    file = tmp_path / "tree.json"
    file.write_text("{}")
    with pytest.raises(InputError, match=r"holds no tree of a run: input should be a valid array"):
        read_tree(file)
